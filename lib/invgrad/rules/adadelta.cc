#include "invgrad/rules/adadelta.h"

#include <limits>

#include "invgrad/core/finite.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void Adadelta::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("decay",
           &decay,
           {0.0, 1.0, false, true},
           "memory of squared gradient and step");
  set->Add(
      "epsilon", &epsilon, {0.0, kInfinity, true}, "added under the roots");
}

Adadelta::Adadelta(const Options& options) : options_(options) {
  CheckOptions(options);
}

bool Adadelta::ComputeStep(const Linearization& at_x,
                           Eigen::VectorXd* step,
                           std::string* error) {
  const Eigen::VectorXd& gradient = at_x.gradient;
  if (!CheckFinite("the gradient", gradient, error)) return false;
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  InitializeOnce(gradient.size(), 0.0, &mean_square_delta_);
  mean_square_ = options_.decay * mean_square_ +
                 (1.0 - options_.decay) * gradient.cwiseAbs2();
  // An infinite square would make all further steps of its entry zero.
  if (!CheckFinite("the squared gradient", mean_square_, error)) return false;
  const Eigen::VectorXd delta =
      gradient.array() * ((mean_square_delta_.array() + options_.epsilon) /
                          (mean_square_.array() + options_.epsilon))
                             .sqrt();
  mean_square_delta_ = options_.decay * mean_square_delta_ +
                       (1.0 - options_.decay) * delta.cwiseAbs2();
  *step = -options_.step_size.Scheduled(at_x.progress) * delta;
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
