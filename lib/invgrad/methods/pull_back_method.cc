#include "invgrad/methods/pull_back_method.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "fmt/format.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Sets *way to the way with this name. Returns false, with the allowed names,
// if there is none.
template <typename Way, std::size_t kSize>
bool SetWay(const char* part,
            const char* const (&names)[kSize],
            const std::string& name,
            Way* way,
            std::string* error) {
  const auto* const found = std::find(names, names + kSize, name);
  if (found != names + kSize) {
    *way = static_cast<Way>(found - names);
    return true;
  }
  *error = fmt::format("'{}' is no way back through the {}; allowed: {}",
                       name,
                       part,
                       fmt::join(names, ", "));
  return false;
}

}  // namespace

bool PullBackMethod::SetWays(const std::string& loss,
                             const std::string& simulator,
                             std::string* error) {
  return SetWay("loss", kLossWayNames, loss, &loss_, error) &&
         SetWay("simulator", kSimulatorWayNames, simulator, &simulator_, error);
}

void PullBackMethod::Describe(OptionSet* set) {
  set->Add("y_step_size",
           &y_step_size_,
           {0.0, kInfinity, true},
           "eta of the step in y");
  if (is_joint()) return;
  set->Add("proxy", &proxy_, {"l2", "l1"}, "distance to the wanted x");
  set->Add("curvature_weight",
           &curvature_weight_,
           {0.0, 1.0},
           "exponent of the loss's curvature along d_x in a sample's weight");
  set->Add("updates",
           &updates_,
           {1, 1e6},
           "updates of the network per evaluation of the simulator");
  set->Add("max_change",
           &max_change_,
           {0.0, kInfinity},
           "longest |d_x| of a sample; 0: any");
  set->Add("threads", &threads_, {1, 1024}, "threads, over the samples");
  if (simulator_ == SimulatorWay::kData) return;
  set->Add("data_weight",
           &data_weight_,
           {0.0, kInfinity},
           "weight of 1/2 |x - x*|^2, x* the data's own solution");
  if (simulator_ == SimulatorWay::kAdjoint) return;
  set->Add("pull_back_truncation",
           &pull_back_truncation_,
           {0.0, 1.0, false, true},
           "tau of the simulator's (half-)inverse gradient");
  if (simulator_ == SimulatorWay::kInverseGradient ||
      simulator_ == SimulatorWay::kHalfInverse) {
    return;
  }
  set->Add("round_trip",
           &round_trip_,
           {0.0, kInfinity, true},
           "allowed |P(x~) - y~| / |y~ - y| of an inverse");
  set->Add("accept_nearer",
           &accept_nearer_,
           "take every answer that is nearer to y~ than y is");
  set->Add("inverse_iterations",
           &inverse_iterations_,
           {1, 1e6},
           "at most, of the numerical inverse");
  if (simulator_ != SimulatorWay::kNewton) return;
  set->Add("newton_steps", &newton_steps_, {1, 1e6}, "steps of the inverse");
  set->Add(
      "max_loss_change",
      &max_loss_change_,
      {0.0, kInfinity, true},
      "bound along directions that curve less than the mean; with one input: "
      "along all");
  set->Add("newton_damping", &damping_, {0.0, kInfinity}, "added to |lambda|");
}

bool PullBackMethod::CanPullBack(const Simulator& simulator,
                                 std::string* error) const {
  return simulator_ != SimulatorWay::kNewton ||
         CheckHasHessian(simulator, error);
}

SimulatorPullBack::Options PullBackMethod::SimulatorOptions() const {
  SimulatorPullBack::Options options;
  options.way = simulator_;
  options.truncation = pull_back_truncation_;
  options.round_trip = round_trip_;
  options.accept_nearer = accept_nearer_;
  options.max_num_iterations = inverse_iterations_;
  options.newton.num_steps = newton_steps_;
  options.newton.max_loss_change = max_loss_change_;
  options.newton.damping = damping_;
  return options;
}

LossPullBack PullBackMethod::MakeLossPullBack(
    std::shared_ptr<const Loss> loss) const {
  return LossPullBack(std::move(loss), loss_, y_step_size_);
}

std::shared_ptr<const Loss> PullBackMethod::MakeLoss(
    std::shared_ptr<const Loss> loss) const {
  CHECK(is_joint());
  // The gradient of the loss itself: there is nothing to pull back.
  if (loss_ == LossWay::kGradient && y_step_size_ == 1.0) return loss;
  return std::make_shared<LossPullBack>(MakeLossPullBack(std::move(loss)));
}

ChainPullBack::Options PullBackMethod::ChainOptions() const {
  CHECK(!is_joint());
  ChainPullBack::Options options;
  options.loss = loss_;
  options.y_step_size = y_step_size_;
  options.simulator = SimulatorOptions();
  options.proxy =
      proxy_ == "l2" ? ChainPullBack::Proxy::kL2 : ChainPullBack::Proxy::kL1;
  options.curvature_weight = curvature_weight_;
  if (max_change_ > 0.0) options.max_change = max_change_;
  options.data_weight = data_weight_;
  options.updates_per_evaluation = updates_;
  options.num_threads = threads_;
  return options;
}

SimulatorPullBack PullBackMethod::MakeSimulatorPullBack(
    const std::shared_ptr<const Simulator>& simulator,
    std::shared_ptr<const InverseSimulator> inverse) const {
  return SimulatorPullBack(simulator, std::move(inverse), SimulatorOptions());
}

std::vector<OptionSet::Row> ChainMethodRow::options() const {
  PullBackMethod method;
  std::string error;
  CHECK(method.SetWays(loss, simulator, &error)) << error;
  OptionSet set;
  method.Describe(&set);
  std::vector<OptionSet::Row> rows = FindRule(rule)->options();
  rows.insert(rows.end(), set.rows().begin(), set.rows().end());
  for (OptionSet::Row& row : rows) {
    for (const auto& [name, value] : defaults) {
      if (row.name == name) row.default_value = value;
    }
  }
  return rows;
}

const std::vector<ChainMethodRow>& ChainMethods() {
  static const auto& rows = *new std::vector<ChainMethodRow>{
      {"dp_adam",
       "differentiable physics: gradient/adjoint/adam, the gradient of the "
       "whole chain",
       "gradient",
       "adjoint",
       "adam",
       {}},
      {"supervised",
       "newton/data/adam: |f - x*|^2, x* the solution that the data were made "
       "from",
       "newton",
       "data",
       "adam",
       {}},
      {"physics_informed",
       "gradient/adjoint/adam with data_weight 1: L + 1/2 |f - x*|^2",
       "gradient",
       "adjoint",
       "adam",
       {{"data_weight", "1"}}},
      {"sip",
       "scale-invariant physics training: newton/inverse/adam, |f - (x + "
       "P^-1(y + d_y; x) - x)|^2",
       "newton",
       "inverse",
       "adam",
       {}},
      {"physical_gradient",
       "newton/inverse/gradient_descent with step size 1: x <- P^-1(y + d_y; "
       "x)",
       "newton",
       "inverse",
       "gradient_descent",
       {{"step_size", "1"}}},
      {"hig",
       "half-inverse gradients: gradient/joint/half_inverse",
       "gradient",
       "joint",
       "half_inverse",
       {}},
  };
  return rows;
}

const ChainMethodRow* FindChainMethod(const std::string& name) {
  for (const ChainMethodRow& row : ChainMethods()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

}  // namespace invgrad
