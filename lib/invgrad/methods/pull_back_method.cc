#include "invgrad/methods/pull_back_method.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/internal/logging.h"
#include "invgrad/inverse_simulator.h"

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
  *error =
      fmt::format("'{}' cannot pull a change back through the {}; allowed: {}",
                  name,
                  part,
                  fmt::join(names, ", "));
  return false;
}

}  // namespace

bool PullBackMethod::SetWays(const std::string& text,
                             std::string* rule,
                             std::string* error) {
  const std::size_t first = text.find('/');
  const std::size_t second = text.find('/', first + 1);
  if (second == std::string::npos ||
      text.find('/', second + 1) != std::string::npos) {
    *error = fmt::format("'{}': wanted LOSS/SIMULATOR/RULE", text);
    return false;
  }
  *rule = text.substr(second + 1);
  return SetWay("loss",
                kLossWayNames,
                text.substr(0, first),
                &options_.loss,
                error) &&
         SetWay("simulator",
                kSimulatorWayNames,
                text.substr(first + 1, second - first - 1),
                &options_.simulator.way,
                error);
}

void PullBackMethod::Describe(OptionSet* set) {
  set->Add("y_step_size",
           &options_.y_step_size,
           {0.0, kInfinity, true},
           "eta of the step in y");
  if (is_joint()) return;
  set->Add("proxy", &proxy_, {"l2", "l1"}, "distance to the wanted x");
  set->Add("curvature_weight",
           &options_.curvature_weight,
           {0.0, 1.0},
           "exponent of the loss's curvature along d_x in a sample's weight");
  set->Add("updates",
           &options_.updates_per_evaluation,
           {1, 1e6},
           "updates of the network per evaluation of the simulator");
  set->Add("max_change",
           &max_change_,
           {0.0, kInfinity},
           "longest |d_x| of a sample; 0: any");
  if (way() == SimulatorWay::kData) return;
  set->Add("data_weight",
           &options_.data_weight,
           {0.0, kInfinity},
           "weight of 1/2 |x - x*|^2, x* the data's own solution");
  if (way() != SimulatorWay::kAdjoint) DescribeInverse(set);
}

// What carries the step in y back to x.
void PullBackMethod::DescribeInverse(OptionSet* set) {
  if (way() == SimulatorWay::kGradientDescent) {
    GradientDescentOptions& descent = options_.simulator.gradient_descent;
    set->Add(
        "inner_steps", &descent.num_steps, {1, 1e6}, "gradient steps in x");
    set->Add("inner_step_size",
             &descent.step_size,
             {0.0, kInfinity, true},
             "step size of these steps; too long if above 2 / s_max^2 of the "
             "simulator, for 1/2 |P(x) - y~|^2");
    set->Add("inner_rescale",
             &descent.rescale,
             "scale the sum of these steps to the length of the first");
    return;
  }
  if (way() == SimulatorWay::kLbfgs) {
    LbfgsOptions& lbfgs = options_.simulator.lbfgs;
    set->Add("inner_steps",
             &lbfgs.max_num_iterations,
             {1, 1e6},
             "iterations of L-BFGS in x, at most");
    set->Add("inner_tolerance",
             &lbfgs.tolerance,
             {0.0, kInfinity},
             "relative change of the value or the gradient at which they end");
    return;
  }
  set->Add("pull_back_truncation",
           &options_.simulator.truncation,
           {0.0, 1.0, false, true},
           "tau of the simulator's (half-)inverse gradient");
  if (way() == SimulatorWay::kInverseGradient ||
      way() == SimulatorWay::kHalfInverse) {
    return;
  }
  set->Add("round_trip",
           &options_.simulator.round_trip,
           {0.0, kInfinity, true},
           "allowed |P(x~) - y~| / |y~ - y| of an inverse");
  set->Add("accept_nearer",
           &options_.simulator.accept_nearer,
           "take every answer that is nearer to y~ than y is");
  set->Add("inverse_iterations",
           &options_.simulator.max_num_iterations,
           {1, 1e6},
           "at most, of the numerical inverse");
  if (way() != SimulatorWay::kNewton) return;
  NewtonInverse::Options& newton = options_.simulator.newton;
  set->Add("newton_steps", &newton.num_steps, {1, 1e6}, "steps of the inverse");
  set->Add(
      "max_loss_change",
      &newton.max_loss_change,
      {0.0, kInfinity, true},
      "bound along directions that curve less than the mean; with one input: "
      "along all");
  set->Add(
      "newton_damping", &newton.damping, {0.0, kInfinity}, "added to |lambda|");
}

bool PullBackMethod::CanPullBack(const Simulator& simulator,
                                 std::string* error) const {
  return way() != SimulatorWay::kNewton || CheckHasHessian(simulator, error);
}

LossPullBack PullBackMethod::MakeLossPullBack(
    std::shared_ptr<const Loss> loss) const {
  return LossPullBack(std::move(loss), options_.loss, options_.y_step_size);
}

std::shared_ptr<const Loss> PullBackMethod::MakeLoss(
    std::shared_ptr<const Loss> loss) const {
  CHECK(is_joint());
  if (lowers_loss()) return loss;
  return std::make_shared<LossPullBack>(MakeLossPullBack(std::move(loss)));
}

ChainPullBack::Options PullBackMethod::ChainOptions() const {
  CHECK(!is_joint());
  ChainPullBack::Options options = options_;
  options.proxy =
      proxy_ == "l2" ? ChainPullBack::Proxy::kL2 : ChainPullBack::Proxy::kL1;
  if (max_change_ > 0.0) options.max_change = max_change_;
  return options;
}

SimulatorPullBack PullBackMethod::MakeSimulatorPullBack(
    const std::shared_ptr<const Simulator>& simulator,
    std::shared_ptr<const InverseSimulator> inverse) const {
  return SimulatorPullBack(simulator, std::move(inverse), options_.simulator);
}

std::vector<OptionSet::Row> ChainMethodRow::options() const {
  PullBackMethod method;
  std::string rule;
  std::string error;
  CHECK(method.SetWays(ways, &rule, &error)) << error;
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
       "gradient/adjoint/adam",
       {}},
      {"supervised",
       "newton/data/adam: |f - x*|^2, x* the solution that the data were made "
       "from",
       "newton/data/adam",
       {}},
      {"physics_informed",
       "gradient/adjoint/adam with data_weight 1: L + 1/2 |f - x*|^2",
       "gradient/adjoint/adam",
       {{"data_weight", "1"}}},
      {"sip",
       "scale-invariant physics training: newton/inverse/adam, |f - (x + "
       "P^-1(y + d_y; x) - x)|^2",
       "newton/inverse/adam",
       {}},
      {"sip_gradient",
       "scale-invariant physics training by the inverse gradient of the "
       "simulator: newton/inverse_gradient/adam",
       "newton/inverse_gradient/adam",
       {}},
      {"physical_gradient",
       "newton/inverse/gradient_descent with step size 1: x <- P^-1(y + d_y; "
       "x)",
       "newton/inverse/gradient_descent",
       {{"step_size", "1"}}},
      {"hig",
       "half-inverse gradients: gradient/joint/half_inverse",
       "gradient/joint/half_inverse",
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
