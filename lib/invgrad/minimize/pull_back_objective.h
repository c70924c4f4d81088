// The proxy of a pull-back through simulator and loss to x, without a network:
//
//   x~ = x + d_x,   proxy 1/2 |x - x~|^2,   gradient = -d_x,   J = H_L = 1
//
// With a full step this is x <- P^-1(y + d_y; x). The cost is L at x.
#ifndef INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_
#define INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_

#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/internal/objective.h"
#include "invgrad/inverse/loss_pull_back.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/linearization.h"
#include "invgrad/minimize.h"

namespace invgrad {

class PullBackObjective final : public Objective {
 public:
  // `objective` holds the point.
  PullBackObjective(PointObjective* objective,
                    LossPullBack loss,
                    SimulatorPullBack simulator)
      : objective_(*objective),
        target_(objective->target()),
        loss_(std::move(loss)),
        simulator_(std::move(simulator)) {}

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
  PointObjective& objective_;
  const Eigen::VectorXd target_;
  LossPullBack loss_;
  SimulatorPullBack simulator_;
  mutable PullBackCounts counts_;
};

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_PULL_BACK_OBJECTIVE_H_
