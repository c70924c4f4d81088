// A simulator and a loss without a network: the unknowns are x.
//
//   L(x) = L(P(x), y*),   J = dP/dx,   g = dL/dy
//   d2L/dx2 = J^T H_L J + sum_i g_i d2P_i/dx2
//
// Shapes:  x: n = |x|;  y: m = |y|.
// Units:   g and J are derivatives for y, not for a residual: L = c |y - y*|^2
//          has g = 2 c (y - y*) and H_L = 2 c I.
// Cost:    the gradient alone: the simulator's adjoint, without J. Otherwise
//          one simulator evaluation with Jacobian, or one Linearize if the
//          simulator does not form it; the Hessian adds one. H_L is stored only
//          if the loss is not a squared norm.
// Fails:   Linearize and Cost return false if simulator or loss fails or a
//          value is not finite, and if J and the Hessian, which are dense, do
//          not fit into memory.
#ifndef INVGRAD_MINIMIZE_CHAIN_OBJECTIVE_H_
#define INVGRAD_MINIMIZE_CHAIN_OBJECTIVE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/first_order_function.h"
#include "invgrad/ceres/second_order_cost_function.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/objective.h"

namespace invgrad {

// The messages for a point without a finite value.
inline constexpr char kNoOutputs[] = "the simulator has no finite value at x";
inline constexpr char kNoLoss[] = "the loss has no finite value at y";

class ChainObjective final : public Objective {
 public:
  // Sizes must fit, and the simulator must not need a context (CHECKed).
  ChainObjective(std::shared_ptr<const Simulator> simulator,
                 std::shared_ptr<const Loss> loss,
                 Eigen::VectorXd target,
                 Eigen::VectorXd start);

  int num_parameters() const override { return simulator_->num_inputs(); }
  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override;
  Eigen::VectorXd State() const override { return x_; }
  void SetState(const Eigen::VectorXd& state) override;
  bool Plus(const Eigen::VectorXd& step) override;

  // y = P(x); empty if the simulator fails.
  Eigen::VectorXd Outputs() const;

  const Simulator& simulator() const { return *simulator_; }
  const Loss& loss() const { return *loss_; }
  std::shared_ptr<const Simulator> shared_simulator() const {
    return simulator_;
  }
  std::shared_ptr<const Loss> shared_loss() const { return loss_; }
  const Eigen::VectorXd& target() const { return target_; }

 private:
  // L and, unless null, g.
  bool EvaluateLoss(double* cost, double* gradient, std::string* error) const;
  bool PullBackGradient(Linearization* linearization, std::string* error) const;
  // The message if the simulator fails.
  std::string OutputsError() const;
  bool LinearizeWithJacobian(const LinearizationParts& parts,
                             Linearization* linearization,
                             std::string* error) const;

  std::shared_ptr<const Simulator> simulator_;
  std::shared_ptr<const Loss> loss_;
  Eigen::VectorXd target_;
  Eigen::VectorXd x_;
};

// r = sqrt(2 c) (P(x) - y*) of a squared-norm loss (CHECKed), one parameter
// block: the objective as a residual block of a ceres::Problem.
class ChainCostFunction final : public SecondOrderCostFunction {
 public:
  // The objective must outlive the function; its current point is not used.
  explicit ChainCostFunction(const ChainObjective* objective);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;
  bool WeightedHessian(double const* const* parameters,
                       const double* w,
                       double* hessian) const override;

 private:
  const ChainObjective* objective_;
  double scale_;  // sqrt(2 c)
};

// L and its gradient, for Ceres' line searches.
class ChainFunction final : public ceres::FirstOrderFunction {
 public:
  explicit ChainFunction(const ChainObjective* objective)
      : objective_(objective) {}
  bool Evaluate(const double* parameters,
                double* cost,
                double* gradient) const override;
  int NumParameters() const override { return objective_->num_parameters(); }

 private:
  const ChainObjective* objective_;
};

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_CHAIN_OBJECTIVE_H_
