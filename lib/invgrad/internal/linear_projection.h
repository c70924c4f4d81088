// Linear least squares by a complete orthogonal decomposition: the solution of
// least norm, and the projection onto what Phi does not reach.
//
//   minimize |Phi c + r|:   c = -Phi^+ r,   least residual (I - Phi Phi^+) r
//   Phi D^-1 P = Q [T 0; 0 0] Z,   D = diag(|Phi e_j|)
//
// The rank is the number of pivots of the QR decomposition above
// rank_threshold times the largest. Columns are scaled to length one, so that
// rank and solution do not depend on the units of c. Of all solutions, that of
// the least |D c| is taken; Phi^+ is the pseudo-inverse in this norm.
//
// Shapes:  Phi: m x p, m < p is allowed; r: m; c: p.
// Cost:    4 m p min(m, p) operations, and 4 m p for each projected column.
// Fails:   never; Phi must be finite.
#ifndef INVGRAD_INTERNAL_LINEAR_PROJECTION_H_
#define INVGRAD_INTERNAL_LINEAR_PROJECTION_H_

#include "Eigen/Core"
#include "Eigen/QR"

namespace invgrad {

// With s the smallest relative singular value that counts, c and Kaufman's
// Jacobian (reduced_cost.h) have relative errors of 1e-16 / s. Exactly
// dependent columns have pivots of 1e-15.
constexpr double kLinearRankThreshold = 1e-10;

class LinearProjection {
 public:
  LinearProjection(const Eigen::MatrixXd& Phi, double rank_threshold);

  int rank() const { return static_cast<int>(decomposition_.rank()); }

  // Phi^+ M, for the m rows of M.
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& M) const;
  // (Phi^+)^T M, for the p rows of M.
  Eigen::MatrixXd SolveTransposed(const Eigen::MatrixXd& M) const;
  // (I - Phi Phi^+) M
  Eigen::MatrixXd Residual(const Eigen::MatrixXd& M) const;
  // An orthonormal basis of the range of Phi, m x rank: Phi Phi^+ = Q_1 Q_1^T.
  const Eigen::MatrixXd& range() const { return Q_1_; }

 private:
  Eigen::VectorXd scale_;  // D
  Eigen::MatrixXd Q_1_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition_;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_LINEAR_PROJECTION_H_
