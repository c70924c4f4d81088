#include "invgrad/rules/adam.h"

#include <cmath>
#include <limits>

#include "invgrad/core/finite.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void Adam::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("beta1", &beta1, {0.0, 1.0, false, true}, "memory of the gradient");
  set->Add("beta2",
           &beta2,
           {0.0, 1.0, false, true},
           "memory of the squared gradient");
  set->Add("epsilon", &epsilon, {0.0, kInfinity, true}, "added to the root");
}

Adam::Adam(const Options& options) : options_(options) {
  CheckOptions(options);
}

bool Adam::ComputeStep(const Linearization& at_x,
                       Eigen::VectorXd* step,
                       std::string* error) {
  const Eigen::VectorXd& gradient = at_x.gradient;
  if (!CheckFinite("the gradient", gradient, error)) return false;
  InitializeOnce(gradient.size(), 0.0, &mean_);
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  num_steps_[0] += 1.0;
  mean_ = options_.beta1 * mean_ + (1.0 - options_.beta1) * gradient;
  mean_square_ = options_.beta2 * mean_square_ +
                 (1.0 - options_.beta2) * gradient.cwiseAbs2();
  // An infinite square would make all further steps of its entry zero.
  if (!CheckFinite("the squared gradient", mean_square_, error)) return false;
  // Corrects the bias of means that start from zero.
  const double mean_weight = 1.0 - std::pow(options_.beta1, num_steps_[0]);
  const double mean_square_weight =
      1.0 - std::pow(options_.beta2, num_steps_[0]);
  *step =
      -options_.step_size.Scheduled(at_x.progress) / mean_weight *
      mean_.array() /
      ((mean_square_.array() / mean_square_weight).sqrt() + options_.epsilon);
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
