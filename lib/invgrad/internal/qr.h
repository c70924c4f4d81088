// Thin QR decompositions by LAPACK.
//
//   A = Q R,   A: m x n,  Q: m x k,  R: k x n,  k = min(m, n)
//
// Q has orthonormal columns, R is upper triangular (a trapezoid if m < n).
// Cost: O(m n k). Fails: never; if A is not finite, Q and R are not.
#ifndef INVGRAD_INTERNAL_QR_H_
#define INVGRAD_INTERNAL_QR_H_

#include "Eigen/Core"

namespace invgrad {

struct ThinQr {
  explicit ThinQr(Eigen::MatrixXd A);

  Eigen::MatrixXd Q;
  Eigen::MatrixXd R;
};

// Q alone.
Eigen::MatrixXd Orthonormalized(Eigen::MatrixXd A);

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_QR_H_
