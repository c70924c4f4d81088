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
  // Of gram: J J^T or J^T J, divided by `unit`; then the reflectors of its
  // reduction, or its eigenvectors.
  Eigen::MatrixXd gram;
  double unit = 1.0;
  Eigen::VectorXd b;  // what the function of the Gram matrix is applied to
  Eigen::VectorXd y;
  Eigen::VectorXd product;
  Tridiagonalization reduction;
  Tridiagonal tridiagonal;
  Tridiagonal::Perturbations perturbations;
  Tridiagonal::Changes changes;
  Eigen::VectorXd change;
  Eigen::VectorXd values;  // the eigenvalues, where all are computed
  std::vector<ContourNode> nodes;
  std::vector<std::complex<double>> shifts;
  std::vector<std::complex<double>> coefficients;

  // Of svd.
  Eigen::MatrixXd J;
  Eigen::MatrixXd tall;
  TallSvd svd;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRAL_BUFFERS_H_
