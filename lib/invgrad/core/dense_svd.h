// The thin singular value decomposition of a dense matrix by LAPACK's divide
// and conquer.
//
//   A = U diag(s) V^T
//
// If A is much taller than wide, a QR factorization comes first [1],
//
//   A = Q R,   R = W diag(s) V^T,   U = Q W,
//
// and Q is only applied to vectors; otherwise Q = 1.
//
// Shapes:  A: m x n;  U: m x k;  s: k, descending;  V: n x k;  k = min(m, n).
// Cost:    2 m n^2 + 22 n^3 for m >= n. A second matrix of the same size
//          allocates nothing.
// Fails:   Compute returns false if A is not finite, if R or s overflows, or if
//          neither divide and conquer nor QR iterations converge.
//
// For single samples see small_svd.h, for steps spectral.h.
//
// [1] Chan. An improved algorithm for computing the singular value
//     decomposition. ACM TOMS 8 (1982).
#ifndef INVGRAD_CORE_DENSE_SVD_H_
#define INVGRAD_CORE_DENSE_SVD_H_

#include "Eigen/Core"

namespace invgrad {

class DenseSvd {
 public:
  // A, to be set before Compute, which overwrites it.
  Eigen::MatrixXd* mutable_matrix() { return &A_; }
  bool Compute();

  const Eigen::VectorXd& s() const { return s_; }
  const Eigen::MatrixXd& Vt() const { return Vt_; }
  const Eigen::MatrixXd& W() const { return W_; }
  Eigen::MatrixXd U() const;
  // U^T D.
  Eigen::MatrixXd UTransposeTimes(Eigen::MatrixXd D) const;
  // *X = Q X or Q^T X, for X with m rows.
  void ApplyQ(bool transpose, Eigen::Ref<Eigen::MatrixXd> X) const;

 private:
  bool is_reduced() const { return tau_.size() > 0; }

  Eigen::MatrixXd A_;    // later the reflectors of Q, if it is reduced
  Eigen::VectorXd tau_;  // of the reflectors; empty if Q = 1
  Eigen::MatrixXd R_;
  Eigen::MatrixXd copy_;  // of what divide and conquer overwrites
  Eigen::MatrixXd W_;
  Eigen::VectorXd s_;
  Eigen::MatrixXd Vt_;
};

// The min(m, n) singular values, descending; NaN where Compute would fail.
Eigen::VectorXd SingularValues(Eigen::MatrixXd A);

}  // namespace invgrad

#endif  // INVGRAD_CORE_DENSE_SVD_H_
