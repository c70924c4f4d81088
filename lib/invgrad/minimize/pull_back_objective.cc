#include "invgrad/minimize/pull_back_objective.h"

#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "invgrad/core/jacobian_operator.h"

namespace invgrad {

PullBackObjective::PullBackObjective(ChainObjective* objective,
                                     LossPullBack loss,
                                     SimulatorPullBack simulator)
    : objective_(*objective),
      loss_(std::move(loss)),
      simulator_(std::move(simulator)) {}

bool PullBackObjective::Linearize(const LinearizationParts& parts,
                                  Linearization* linearization,
                                  std::string* error) const {
  const Eigen::VectorXd x = objective_.State();
  Eigen::VectorXd y(objective_.target().size());
  Eigen::VectorXd d_x(x.size());
  SimulatorPullBack::Result result;
  error->clear();
  const auto wanted_change = [&](const double* at, double* change) {
    return loss_.Step(
        at, objective_.target().data(), &linearization->cost, change, error);
  };
  if (!simulator_(x,
                  Eigen::VectorXd(),
                  std::cref(wanted_change),
                  y.data(),
                  d_x,
                  &result)) {
    if (error->empty()) *error = "the simulator has no finite value at x";
    return false;
  }
  if (!std::isfinite(linearization->cost)) {
    *error = "the loss has no finite value at y";
    return false;
  }
  counts_.BeginStep();
  counts_.Add(result, 0);
  const Eigen::Index n = x.size();
  linearization->gradient = -d_x;
  if (parts.jacobian) {
    linearization->loss_gradient = -d_x;
    linearization->jacobian =
        std::make_shared<DenseJacobian>(Eigen::MatrixXd::Identity(n, n));
  }
  if (parts.hessian) linearization->hessian = Eigen::MatrixXd::Identity(n, n);
  return true;
}

}  // namespace invgrad
