#include "invgrad/rules/adagrad.h"

#include <limits>

#include "invgrad/core/finite.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

void Adagrad::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("initial_sum",
           &initial_sum,
           {0.0, kInfinity},
           "sum of squares at the start");
  set->Add("epsilon", &epsilon, {0.0, kInfinity, true}, "added to the root");
}

Adagrad::Adagrad(const Options& options) : options_(options) {
  CheckOptions(options);
}

bool Adagrad::ComputeStep(const Linearization& at_x,
                          Eigen::VectorXd* step,
                          std::string* error) {
  const Eigen::VectorXd& gradient = at_x.gradient;
  if (!CheckFinite("the gradient", gradient, error)) return false;
  InitializeOnce(gradient.size(), options_.initial_sum, &sum_of_squares_);
  sum_of_squares_ += gradient.cwiseAbs2();
  // An infinite square would make all further steps of its entry zero.
  if (!CheckFinite("the squared gradient", sum_of_squares_, error))
    return false;
  *step = -options_.step_size.Scheduled(at_x.progress) * gradient.array() /
          (sum_of_squares_.array().sqrt() + options_.epsilon);
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
