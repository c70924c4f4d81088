#include "invgrad/rules/gradient_descent.h"

#include "invgrad/core/finite.h"

namespace invgrad {

void GradientDescent::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("momentum",
           &momentum,
           {0.0, 1.0, false, true},
           "mu, memory of the velocity");
  set->Add("nesterov", &nesterov, "look ahead along the velocity");
}

GradientDescent::GradientDescent(const Options& options) : options_(options) {
  CheckOptions(options);
}

bool GradientDescent::ComputeStep(const Linearization& at_x,
                                  Eigen::VectorXd* step,
                                  std::string* error) {
  const Eigen::VectorXd& gradient = at_x.gradient;
  if (!CheckFinite("the gradient", gradient, error)) return false;
  InitializeOnce(gradient.size(), 0.0, &velocity_);
  velocity_ = options_.momentum * velocity_ + gradient;
  const double eta = options_.step_size.Scheduled(at_x.progress);
  if (options_.nesterov) {
    *step = -eta * (gradient + options_.momentum * velocity_);
  } else {
    *step = -eta * velocity_;
  }
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
