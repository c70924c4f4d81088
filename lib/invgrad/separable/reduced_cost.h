// The reduced cost of the residual blocks that share linear parameters: a cost
// function of the other parameters alone.
//
//   c(alpha) = argmin_c 1/2 |r(alpha, c)|^2,   f(alpha) = r(alpha, c(alpha))
//
//   r(alpha, c) = r_0 + Phi c,   c = -Phi^+ r_0,   f = (I - Phi Phi^+) r_0
//   A = dr/dalpha at c(alpha)
//   Kaufman [1]          df/dalpha = (I - Phi Phi^+) A
//   Golub and Pereyra [2]          - (Phi^+)^T G,
//                        G_jk = (d(Phi e_j)/dalpha_k)^T f
//
// The second line makes it exact, where the rank is constant. It is orthogonal
// to f, so that both Jacobians give the same gradient, that of the reduced
// cost. As r is affine in c, G needs no second derivatives: column by column,
// G_j = (A(alpha, e_j) - A(alpha, 0))^T f.
//
// Robust losses: c minimizes 1/2 sum_b rho_b(|r_b|^2) by reweighting,
//
//   c <- argmin_c sum_b rho_b'(|r_b|^2) |r_b(alpha, c)|^2,
//
// until r no longer changes, 200 times at most; the change of c is halved while
// the cost rises. f_b is then that of root_loss.h, and Phi and A are its
// derivatives; as Phi^T f = 0, Kaufman's Jacobian gives the exact gradient
// here, too. A loss that is much narrower than the residuals is close to the L1
// norm, where reweighting may need far more steps than 200: damped Newton steps
// come after these, 100 at most. For losses of width 1e-6 to 0.03 at residuals
// of 0.05 to 1 the gradient then has errors below 1e-4. Reweighting starts from
// the c of the last state with a Jacobian, which an accepted step leads to. If
// rows that lose their weight (rho' = 0) leave c open, it starts again from the c
// of least squares, and the lower cost counts.
//
// Cost:    an evaluation without Jacobian is one of r and Phi and a
//          decomposition; with Jacobian, one of r, A and Phi more, and p + 1
//          more for the Jacobian of Golub and Pereyra.
// Fails:   Evaluate returns false if a cost function does, a value is not
//          finite or a loss has rho < 0 or rho' < 0.
//
// [1] Kaufman. A variable projection method for solving separable nonlinear
//     least squares problems. BIT 15 (1975).
// [2] Golub, Pereyra. The differentiation of pseudo-inverses and nonlinear
//     least squares problems whose variables separate. SIAM J. Numer. Anal. 10
//     (1973).
#ifndef INVGRAD_SEPARABLE_REDUCED_COST_H_
#define INVGRAD_SEPARABLE_REDUCED_COST_H_

#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "invgrad/internal/linear_projection.h"
#include "invgrad/separable/component_residuals.h"

namespace invgrad {

class ReducedCost final : public ceres::CostFunction {
 public:
  // Its parameter blocks are residuals.arguments(), or, if there are none, one
  // that it does not read, because Ceres needs one.
  ReducedCost(ComponentResiduals residuals,
              double rank_threshold,
              bool is_golub_pereyra);

  bool Evaluate(double const* const* alpha,
                double* f,
                double** jacobians) const override;

  // c(alpha). False, with *error, as Evaluate.
  bool Solve(const double* const* alpha,
             Eigen::VectorXd* c,
             std::string* error) const;

  const ComponentResiduals& residuals() const { return residuals_; }
  int rank() const { return projection_->rank(); }  // at the last alpha

 private:
  bool SolveAt(const double* const* alpha, std::string* error) const;
  bool Reweight(const Eigen::VectorXd& r_0,
                const Eigen::MatrixXd& Phi,
                std::string* error) const;
  bool ReweightFrom(const Eigen::VectorXd& start,
                    const Eigen::VectorXd& r_0,
                    const Eigen::MatrixXd& Phi,
                    double* lowest,
                    std::string* error) const;
  bool RobustCost(const Eigen::VectorXd& r,
                  double* cost,
                  Eigen::VectorXd* weights,
                  std::string* error) const;
  bool Jacobian(const double* const* alpha, Eigen::MatrixXd* J) const;
  bool SubtractPhiTerm(const double* const* alpha, Eigen::MatrixXd* J) const;

  const ComponentResiduals residuals_;
  const double rank_threshold_;
  const bool is_golub_pereyra_;
  // All values but those of purely linear blocks, at the last evaluation, and
  // what follows from them.
  mutable std::vector<double> state_;
  mutable Eigen::VectorXd c_;
  mutable Eigen::VectorXd r_;
  mutable std::optional<LinearProjection> projection_;
  mutable Eigen::VectorXd start_;  // of the reweighting
};

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_REDUCED_COST_H_
