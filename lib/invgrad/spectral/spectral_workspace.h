// The memory of spectral steps, kept from one to the next.
//
// A step of the same shape by the Gram route, not clamped and of size 64 or
// more, allocates nothing; the others reuse their large arrays. What the last
// step learned about the spectrum chooses the next one's route; the numbers
// never depend on it otherwise.
//
// One workspace belongs to one run, and to one thread at a time.
#ifndef INVGRAD_SPECTRAL_SPECTRAL_WORKSPACE_H_
#define INVGRAD_SPECTRAL_SPECTRAL_WORKSPACE_H_

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "invgrad/spectral/routes/contour_quadrature.h"
#include "invgrad/spectral/routes/golub_kahan.h"
#include "invgrad/spectral/routes/sparse_cholesky.h"
#include "invgrad/spectral/routes/tridiagonal.h"
#include "invgrad/spectral/routes/tridiagonalization.h"

namespace invgrad {

struct SpectralWorkspace {
  // What SpectralStep remembers of the last step: rows, columns, the route that
  // gave the answer, its rank, and the steps since the cheapest route was last
  // tried and since Golub-Kahan failed. Empty or zero before the first. A
  // checkpoint that holds it resumes bit for bit.
  static constexpr int kHistorySize = 6;
  Eigen::VectorXd history;

  // The rest are buffers of the routes, named by their use.
  // J J^T or J^T J, then the reflectors of its reduction, or its eigenvectors.
  Eigen::MatrixXd gram;
  double unit = 1.0;  // that `gram` was divided by
  Tridiagonalization reduction;
  Tridiagonal tridiagonal;
  Tridiagonal::Perturbations perturbations;
  Tridiagonal::Changes changes;
  std::vector<ContourNode> nodes;
  std::vector<std::complex<double>> shifts;
  std::vector<std::complex<double>> coefficients;
  Eigen::VectorXd b;  // what the function of the Gram matrix is applied to
  Eigen::VectorXd y;
  Eigen::VectorXd change;
  Eigen::VectorXd product;
  GolubKahanWorkspace golub_kahan;
  SparseCholesky cholesky;
  // Of the SVDs.
  Eigen::MatrixXd dense;
  Eigen::MatrixXd triangle;
  Eigen::MatrixXd left;
  Eigen::MatrixXd right;
  Eigen::MatrixXd basis;
  Eigen::VectorXd values;
  Eigen::VectorXd reflector_scales;
  std::vector<double> lapack_numbers;
  std::vector<int> lapack_integers;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_SPECTRAL_WORKSPACE_H_
