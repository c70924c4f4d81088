#include "invgrad/rules/first_order_rules.h"

#include <cmath>
#include <limits>

#include "invgrad/core/finite.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An infinite square would make all further steps of its entry zero.
bool CheckSquare(const Eigen::VectorXd& square, std::string* error) {
  return CheckFinite("the squared gradient", square, error);
}

}  // namespace

bool FirstOrderRule::ComputeStep(const Linearization& at_x,
                                 Eigen::VectorXd* step,
                                 std::string* error) {
  return CheckFinite("the gradient", at_x.gradient, error) &&
         Advance(
             at_x.gradient, step_size_.Scheduled(at_x.progress), step, error) &&
         CheckFinite("the step", *step, error);
}

void GradientDescent::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("momentum",
           &momentum,
           {0.0, 1.0, false, true},
           "mu, memory of the velocity");
  set->Add("nesterov", &nesterov, "look ahead along the velocity");
}

GradientDescent::GradientDescent(const Options& options)
    : FirstOrderRule(options.step_size), options_(options) {
  CheckOptions(options);
}

bool GradientDescent::Advance(const Eigen::VectorXd& gradient,
                              double eta,
                              Eigen::VectorXd* step,
                              std::string* /*error*/) {
  InitializeOnce(gradient.size(), 0.0, &velocity_);
  velocity_ = options_.momentum * velocity_ + gradient;
  if (options_.nesterov) {
    *step = -eta * (gradient + options_.momentum * velocity_);
  } else {
    *step = -eta * velocity_;
  }
  return true;
}

void Adam::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("beta1", &beta1, {0.0, 1.0, false, true}, "memory of the gradient");
  set->Add("beta2",
           &beta2,
           {0.0, 1.0, false, true},
           "memory of the squared gradient");
  set->Add("epsilon", &epsilon, {0.0, kInfinity, true}, "added to the root");
}

Adam::Adam(const Options& options)
    : FirstOrderRule(options.step_size), options_(options) {
  CheckOptions(options);
}

bool Adam::Advance(const Eigen::VectorXd& gradient,
                   double eta,
                   Eigen::VectorXd* step,
                   std::string* error) {
  InitializeOnce(gradient.size(), 0.0, &mean_);
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  num_steps_[0] += 1.0;
  mean_ = options_.beta1 * mean_ + (1.0 - options_.beta1) * gradient;
  mean_square_ = options_.beta2 * mean_square_ +
                 (1.0 - options_.beta2) * gradient.cwiseAbs2();
  if (!CheckSquare(mean_square_, error)) return false;
  // Corrects the bias of means that start from zero.
  const double mean_weight = 1.0 - std::pow(options_.beta1, num_steps_[0]);
  const double mean_square_weight =
      1.0 - std::pow(options_.beta2, num_steps_[0]);
  *step =
      -eta / mean_weight * mean_.array() /
      ((mean_square_.array() / mean_square_weight).sqrt() + options_.epsilon);
  return true;
}

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

RmsProp::RmsProp(const Options& options)
    : FirstOrderRule(options.step_size), options_(options) {
  CheckOptions(options);
}

bool RmsProp::Advance(const Eigen::VectorXd& gradient,
                      double eta,
                      Eigen::VectorXd* step,
                      std::string* error) {
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  InitializeOnce(gradient.size(), 0.0, &velocity_);
  mean_square_ = options_.decay * mean_square_ +
                 (1.0 - options_.decay) * gradient.cwiseAbs2();
  if (!CheckSquare(mean_square_, error)) return false;
  velocity_ =
      options_.momentum * velocity_.array() +
      gradient.array() / (mean_square_.array().sqrt() + options_.epsilon);
  *step = -eta * velocity_;
  return true;
}

void Adagrad::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("initial_sum",
           &initial_sum,
           {0.0, kInfinity},
           "sum of squares at the start");
  set->Add("epsilon", &epsilon, {0.0, kInfinity, true}, "added to the root");
}

Adagrad::Adagrad(const Options& options)
    : FirstOrderRule(options.step_size), options_(options) {
  CheckOptions(options);
}

bool Adagrad::Advance(const Eigen::VectorXd& gradient,
                      double eta,
                      Eigen::VectorXd* step,
                      std::string* error) {
  InitializeOnce(gradient.size(), options_.initial_sum, &sum_of_squares_);
  sum_of_squares_ += gradient.cwiseAbs2();
  if (!CheckSquare(sum_of_squares_, error)) return false;
  *step = -eta * gradient.array() /
          (sum_of_squares_.array().sqrt() + options_.epsilon);
  return true;
}

void Adadelta::Options::Describe(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/false, set);
  set->Add("decay",
           &decay,
           {0.0, 1.0, false, true},
           "memory of squared gradient and step");
  set->Add(
      "epsilon", &epsilon, {0.0, kInfinity, true}, "added under the roots");
}

Adadelta::Adadelta(const Options& options)
    : FirstOrderRule(options.step_size), options_(options) {
  CheckOptions(options);
}

bool Adadelta::Advance(const Eigen::VectorXd& gradient,
                       double eta,
                       Eigen::VectorXd* step,
                       std::string* error) {
  InitializeOnce(gradient.size(), 0.0, &mean_square_);
  InitializeOnce(gradient.size(), 0.0, &mean_square_delta_);
  mean_square_ = options_.decay * mean_square_ +
                 (1.0 - options_.decay) * gradient.cwiseAbs2();
  if (!CheckSquare(mean_square_, error)) return false;
  const Eigen::VectorXd delta =
      gradient.array() * ((mean_square_delta_.array() + options_.epsilon) /
                          (mean_square_.array() + options_.epsilon))
                             .sqrt();
  mean_square_delta_ = options_.decay * mean_square_delta_ +
                       (1.0 - options_.decay) * delta.cwiseAbs2();
  *step = -eta * delta;
  return true;
}

}  // namespace invgrad
