#include "problems/estimation/information.h"

#include <cmath>
#include <limits>

#include "Eigen/Cholesky"
#include "Eigen/Eigenvalues"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Pivots and eigenvalues below this are rounding errors, where the diagonal is
// one.
constexpr double kRounding = 64 * std::numeric_limits<double>::epsilon();

// Returns false if the matrix is not definite.
bool UpperCholesky(const MatrixXd& information, MatrixXd* root) {
  const Eigen::LLT<MatrixXd> cholesky(information);
  if (cholesky.info() != Eigen::Success) return false;
  *root = cholesky.matrixU();
  // Eigen accepts a NaN pivot, from entries near overflow, as positive.
  return root->allFinite() && (root->diagonal().array().square() >
                               kRounding * information.diagonal().array())
                                  .all();
}

}  // namespace

bool IsDefinite(const MatrixXd& information) {
  MatrixXd unused;
  return UpperCholesky(information, &unused);
}

bool UpperRoot(const MatrixXd& information, MatrixXd* root) {
  if (information != information.transpose()) return false;
  if (UpperCholesky(information, root)) return true;
  const Index size = information.rows();
  VectorXd units(size);
  MatrixXd scaled = information;
  for (Index i = 0; i < size; ++i) {
    const double square = information(i, i);
    const bool is_zero_row = information.row(i).isZero(0.0);
    if (!(square > 0.0) && !is_zero_row) return false;
    units[i] = is_zero_row ? 1.0 : std::sqrt(square);
    scaled.row(i) /= units[i];
    scaled.col(i) /= units[i];
  }
  if (!scaled.allFinite()) return false;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const VectorXd& lambda = eigen.eigenvalues();
  const double largest_error = 1e-5 * static_cast<double>(size);
  if (lambda.minCoeff() < -largest_error) return false;
  const VectorXd roots = (lambda.array() > kRounding)
                             .select(lambda.cwiseMax(0.0).cwiseSqrt(), 0.0);
  *root = roots.asDiagonal() * eigen.eigenvectors().transpose() *
          units.asDiagonal();
  return root->allFinite();
}

}  // namespace invgrad
