// Least squares whose equations arrive in blocks, with the ridge that predicts
// equations best that the solution has not seen.
//
//   min_Z |Z^T H - D|^2 + lambda |Z|^2
//   G = H H^T = V diag(l) V^T,   R = H D^T,   Z = V diag(1 / (l + lambda)) V^T R
//
//   GCV(lambda) = |Z^T H - D|^2 / (m - sum_j l_j / (l_j + lambda))^2        [1]
//
// GCV is the mean of the squared leave-one-out errors, with the leverage of each
// equation replaced by their mean; it needs l, V^T R, |D|^2 and m alone. The
// ridge is the best of a grid with the factor 2, from the resolution of the
// arithmetic to 4 l_max. The rows of D share it.
//
// Shapes:  H: p x m;  D: q x m;  Z: p x q.
// Units:   lambda: those of H^2. Z depends on the relative scales of H's rows
//          where lambda is not small.
// Cost:    m p (p + 2 q) for the equations; Solve: 9 p^3 + 4 p^2 q. Memory:
//          p (p + q) numbers.
// Fails:   Solve returns false if H or D is not finite.
// Edges:   l <= p eps l_max count as zero: directions of H below 1e-8 of the
//          largest one. Without equations, Z = 0.
//
// [1] Golub, Heath, Wahba. Generalized cross-validation as a method for choosing
//     a good ridge parameter. Technometrics 21 (1979), eq. 1.4.
#ifndef INVGRAD_OUTPUT_LAYER_NORMAL_EQUATIONS_H_
#define INVGRAD_OUTPUT_LAYER_NORMAL_EQUATIONS_H_

#include "Eigen/Core"

namespace invgrad {

class NormalEquations {
 public:
  NormalEquations(int num_features, int num_targets);

  // k columns of H and D: p x k, q x k.
  void Add(const Eigen::MatrixXd& H, const Eigen::MatrixXd& D);

  // Adds C^T H to D: Z becomes C + Z, so that the ridge pulls it towards zero and
  // not towards C.
  void MoveOrigin(const Eigen::MatrixXd& C);

  int num_features() const { return static_cast<int>(R_.rows()); }  // p
  int num_targets() const { return static_cast<int>(R_.cols()); }   // q
  double squared_norm() const { return squared_norm_; }             // |D|^2
  double num_equations() const { return num_equations_; }

  struct Solution {
    Eigen::MatrixXd Z;  // p x q
    double ridge = 0.0;
    // |D|^2, and |Z^T H - D|^2 without the ridge.
    double squared_norm = 0.0;
    double squared_residual = 0.0;
    double num_equations = 0.0;  // m
  };
  // least_ridge: the ridge is at least this, in units of l_max.
  bool Solve(double least_ridge, Solution* solution) const;

 private:
  Eigen::MatrixXd G_;  // the lower triangle
  Eigen::MatrixXd R_;
  double squared_norm_ = 0.0;   // |D|^2
  double num_equations_ = 0.0;  // m
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_NORMAL_EQUATIONS_H_
