#include "invgrad/rules/rmsprop.h"

#include <limits>

#include "invgrad/core/finite.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void RmsProp::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("decay",
           &decay,
           {0.0, 1.0, false, true},
           "memory of the squared gradient");
  set->Add("momentum",
           &momentum,
           {0.0, 1.0, false, true},
           "mu, memory of the velocity");
  set->Add("epsilon", &epsilon, {0.0, kInfinity, true}, "added to the root");
}

RmsProp::RmsProp(const Options& options) : options_(options) {
  CheckOptions(options);
}

bool RmsProp::ComputeStep(const Linearization& at_x,
                          Eigen::VectorXd* step,
                          std::string* error) {
  const Eigen::VectorXd& gradient = at_x.gradient;
  if (!CheckFinite("the gradient", gradient, error)) return false;
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  InitializeOnce(gradient.size(), 0.0, &velocity_);
  mean_square_ = options_.decay * mean_square_ +
                 (1.0 - options_.decay) * gradient.cwiseAbs2();
  // An infinite square would make all further steps of its entry zero.
  if (!CheckFinite("the squared gradient", mean_square_, error)) return false;
  velocity_ =
      options_.momentum * velocity_.array() +
      gradient.array() / (mean_square_.array().sqrt() + options_.epsilon);
  *step = -options_.step_size.Scheduled(at_x.progress) * velocity_;
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
