// Right singular vectors of dense matrices, bases that grow, and the order of
// columns; for QR decompositions use internal/qr.h.
//
//   A = U diag(s) V^T,   A P = Q R
//
// O(m n min(m, n)) for m x n. s and V are NaN if the SVD (core/dense_svd.h) does
// not converge, or if A is not finite.
#ifndef INVGRAD_RANK_DECOMPOSITIONS_H_
#define INVGRAD_RANK_DECOMPOSITIONS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct RightSvd {
  Eigen::VectorXd s;  // n, descending; the last n - m are zero up to rounding
  Eigen::MatrixXd V;  // n x n: null vectors included
};
RightSvd ComputeRightSvd(Eigen::MatrixXd A);

// Appends v to Q's orthonormal columns, orthonormalized. Returns false if v, of
// length one, lies in their span up to 1e-4.
bool Extend(const Eigen::VectorXd& v, Eigen::MatrixXd* Q);

// P: the order of the columns of A in a QR decomposition with column pivoting.
std::vector<int> PivotOrder(Eigen::MatrixXd A);

}  // namespace invgrad

#endif  // INVGRAD_RANK_DECOMPOSITIONS_H_
