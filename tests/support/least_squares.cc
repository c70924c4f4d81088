#include "tests/support/least_squares.h"

#include "Eigen/QR"

namespace invgrad {

Eigen::MatrixXd LeastSquares(const Eigen::MatrixXd& A,
                             const Eigen::MatrixXd& B) {
  return A.completeOrthogonalDecomposition().solve(B);
}

}  // namespace invgrad
