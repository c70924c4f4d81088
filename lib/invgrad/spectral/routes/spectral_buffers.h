// The arrays that the routes keep from one step to the next.
#ifndef INVGRAD_SPECTRAL_ROUTES_SPECTRAL_BUFFERS_H_
#define INVGRAD_SPECTRAL_ROUTES_SPECTRAL_BUFFERS_H_

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "invgrad/spectral/routes/contour_quadrature.h"
#include "invgrad/spectral/routes/tall_svd.h"
#include "invgrad/spectral/routes/tridiagonal.h"
#include "invgrad/spectral/routes/tridiagonalization.h"

namespace invgrad {

struct SpectralBuffers {
  // Route gram: J J^T or J^T J, divided by `unit`; later the reflectors of the
  // reduction, or the eigenvectors.
  Eigen::MatrixXd gram;
  double unit = 1.0;
  Eigen::VectorXd b;  // the argument of f(K) b
  Eigen::VectorXd y;
  Eigen::VectorXd product;
  Tridiagonalization reduction;
  Tridiagonal tridiagonal;
  Tridiagonal::Perturbations perturbations;
  Tridiagonal::Changes changes;
  Eigen::VectorXd change;
  Eigen::VectorXd values;  // all eigenvalues, if computed
  std::vector<ContourNode> nodes;
  std::vector<std::complex<double>> shifts;
  std::vector<std::complex<double>> coefficients;

  // Route svd.
  Eigen::MatrixXd J;
  Eigen::MatrixXd tall;
  TallSvd svd;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_BUFFERS_H_
