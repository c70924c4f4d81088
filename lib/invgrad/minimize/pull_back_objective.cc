#include "invgrad/minimize/pull_back_objective.h"

#include <cmath>
#include <functional>
#include <memory>

#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

// The messages for a point without a finite value.
constexpr char kNoOutputs[] = "the simulator has no finite value";
constexpr char kNoLoss[] = "the loss has no finite value";

}  // namespace

bool PullBackObjective::Linearize(const LinearizationParts& parts,
                                  Linearization* linearization,
                                  std::string* error) const {
  const Eigen::VectorXd x = objective_.State();
  Eigen::VectorXd y(target_.size());
  Eigen::VectorXd d_x(x.size());
  SimulatorPullBack::Result result;
  error->clear();
  const auto wanted_change = [&](const double* at, double* change) {
    return loss_.Step(at, target_.data(), &linearization->cost, change, error);
  };
  if (!simulator_(x,
                  Eigen::VectorXd(),
                  std::cref(wanted_change),
                  y.data(),
                  d_x,
                  &result,
                  loss_.Lowered(target_.data()))) {
    if (error->empty()) *error = kNoOutputs;
    return false;
  }
  if (!std::isfinite(linearization->cost)) {
    *error = kNoLoss;
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
  if (parts.hessian) linearization->hessian.setIdentity(n, n);
  if (parts.hessian_times) {
    linearization->hessian_times = [](const auto& v, auto* Hv, auto*) {
      *Hv = v;
      return true;
    };
  }
  return true;
}

}  // namespace invgrad
