// The thin singular value decomposition of a tall matrix, for products with the
// singular vectors.
//
//   A = W diag(s) Z^T
//
// If A is much taller than wide, a QR factorization precedes the SVD (A = Q R,
// R = W' S Z^T, W = Q W'), and Q is only applied to vectors [1].
//
// Shapes:  A: p x q, p >= q;  W: p x q;  s: q, descending;  Z: q x q.
// Cost:    2 p q^2 + 22 q^3 by LAPACK's dgeqrf and dgesdd; 8 (2 p q + 7 q^2)
//          bytes, most of which are kept. dgesvd, which is slower, if dgesdd
//          does not converge.
// Accuracy: backward stable: s to a few roundings of s[0].
// Fails:   Compute returns false if neither converges.
//
// [1] Chan. An improved algorithm for computing the singular value
//     decomposition. ACM TOMS 8 (1982).
#ifndef INVGRAD_SPECTRAL_ROUTES_TALL_SVD_H_
#define INVGRAD_SPECTRAL_ROUTES_TALL_SVD_H_

#include "Eigen/Core"

namespace invgrad {

class TallSvd {
 public:
  // Overwrites *A, possibly with Q; *A must stay alive and unchanged while W is
  // applied. CHECKs p >= q > 0.
  bool Compute(Eigen::MatrixXd* A);

  const Eigen::VectorXd& s() const { return s_; }

  // *y = W^T x, W x, Z^T x, Z x; `x` and `y` must be different.
  void LeftTransposeTimes(const Eigen::VectorXd& x, Eigen::VectorXd* y) const;
  void LeftTimes(const Eigen::VectorXd& x, Eigen::VectorXd* y) const;
  void RightTransposeTimes(const Eigen::VectorXd& x, Eigen::VectorXd* y) const;
  void RightTimes(const Eigen::VectorXd& x, Eigen::VectorXd* y) const;

 private:
  // *x = Q x or Q^T x.
  void ApplyQ(char transpose, Eigen::VectorXd* x) const;

  const Eigen::MatrixXd* A_ = nullptr;  // Q's reflectors, if is_reduced_
  bool is_reduced_ = false;
  Eigen::VectorXd tau_;      // of the reflectors
  Eigen::MatrixXd R_;        // q x q
  Eigen::MatrixXd copy_;     // of what dgesdd overwrites
  Eigen::MatrixXd left_;     // W', or W
  Eigen::MatrixXd right_t_;  // Z^T
  Eigen::VectorXd s_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TALL_SVD_H_
