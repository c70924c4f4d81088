// The proxy of a pull-back through simulator and loss to x, without a network:
// physical gradients of single points.
//
//   x~ = x + d_x,   proxy 1/2 |x - x~|^2,   gradient = -d_x,   J = H_L = 1
//
// With a full step (gradient descent with step size 1) this is x <-
// P^-1(y + d_y; x).
//
// Shapes, cost and failures: simulator_pull_back.h. The gradient is that of the
// proxy; the cost is L at x.
#ifndef INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_
#define INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_

#include <string>

#include "invgrad/core/objective.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/inverse/loss_pull_back.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/minimize/chain_objective.h"

namespace invgrad {

class PullBackObjective final : public Objective {
 public:
  // `objective` holds the point; it must outlive this object.
  PullBackObjective(ChainObjective* objective,
                    LossPullBack loss,
                    SimulatorPullBack simulator);

  int num_parameters() const override { return objective_.num_parameters(); }
  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override {
    return objective_.Cost(cost, error);
  }
  Eigen::VectorXd State() const override { return objective_.State(); }
  void SetState(const Eigen::VectorXd& state) override {
    objective_.SetState(state);
  }
  bool Plus(const Eigen::VectorXd& step) override {
    return objective_.Plus(step);
  }

  // Counts over all linearizations.
  const PullBackCounts& counts() const { return counts_; }

 private:
  ChainObjective& objective_;
  LossPullBack loss_;
  SimulatorPullBack simulator_;
  mutable PullBackCounts counts_;
};

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_
