// The thin singular value decomposition of a tall matrix, by way of its
// triangular factor.
//
//   J = Q R,   R = W diag(s) V^T,   U = Q W
//
// Shapes:  J: m x p;  U: m x k;  s: k, descending;  V: p x k;  k = min(m, p).
// Cost:    2 m p^2 + 22 k^3; U: 4 m p k more, only on request.
// Fails:   Compute returns false if J is not finite.
//
// Source:  Golub, Van Loan. Matrix Computations, 4th ed., section 8.6.3.
#ifndef INVGRAD_OUTPUT_LAYER_TALL_SVD_H_
#define INVGRAD_OUTPUT_LAYER_TALL_SVD_H_

#include "Eigen/Core"

namespace invgrad {

class TallSvd {
 public:
  bool Compute(Eigen::MatrixXd J);

  const Eigen::VectorXd& s() const { return s_; }
  auto V() const { return Vt_.transpose(); }
  Eigen::MatrixXd U() const;
  // U^T d.
  Eigen::MatrixXd Coefficients(Eigen::MatrixXd d) const;
  // s^2 / (s^2 + (root s_max)^2): the parts of U^T d that a solution with this
  // ridge takes.
  Eigen::ArrayXd Shares(double root) const;

 private:
  void ApplyQ(char op, Eigen::MatrixXd* columns) const;

  Eigen::MatrixXd qr_;  // R, and the reflectors of Q below it
  Eigen::VectorXd tau_;
  Eigen::MatrixXd W_;
  Eigen::VectorXd s_;
  Eigen::MatrixXd Vt_;
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_TALL_SVD_H_
