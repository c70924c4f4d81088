#include "invgrad/rules/joint_rule.h"

#include <limits>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

void JointRule::Options::Describe(OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  step_size.Describe(/*allow_auto=*/true, set);
  if (kappa_is_a_setting) {
    set->Add("kappa",
             &filter.kappa,
             {-1.0, 1.0},
             "exponent: -1 gradient, 1/2 half-inverse, 1 Gauss-Newton");
  }
  set->Add("truncation",
           &filter.tau,
           {0.0, 1.0, false, true},
           "tau: singular values s <= tau s_max are dropped");
  set->Add("clamp",
           &filter.clamp,
           "raise small singular values to tau s_max instead");
  set->Add("damping",
           &filter.damping,
           {0.0, kInfinity},
           "lambda, added to the squared singular values");
  set->Add("relative_damping",
           &filter.relative_damping,
           {0.0, kInfinity},
           "the same, in units of s_max^2");
  control.Describe(set);
}

JointRule::JointRule(const Options& options)
    : options_(options), control_(options.control, options.filter) {}

bool JointRule::ComputeStep(const Linearization& at_x,
                            Eigen::VectorXd* step,
                            std::string* error) {
  CHECK(at_x.jacobian != nullptr) << "A joint rule needs J.";
  report_.clear();
  const SpectralFilter filter =
      judges_steps() ? control_.filter() : options_.filter;
  std::string how;
  if (!ComputeDirection(at_x, filter, &d_, &how, error)) return false;
  double eta = 0.0;
  if (!FindStepSize(at_x, &eta, error)) return false;
  *step = -eta * d_;
  if (!CheckFinite("the step", *step, error)) return false;
  report_ = how;
  if (options_.step_size.is_auto()) {
    report_ += fmt::format(", step size {:.2g}", eta);
  }
  if (judges_steps()) {
    report_ += fmt::format(", kappa {:.2g}, damping {:.2g} s_max^2",
                           filter.kappa,
                           filter.relative_damping);
  }
  return true;
}

bool JointRule::FindStepSize(const Linearization& at_x,
                             double* eta,
                             std::string* error) {
  const StepSizeOptions& options = options_.step_size;
  *eta = options.step_size.value_or(1.0);
  // A zero direction gives a zero step for any step size.
  const bool is_zero = d_.isZero(0.0);
  AlongDirection model;
  if (!is_zero && (options.is_auto() || judges_steps())) {
    if (!ModelAlong(at_x, -d_, &model, error)) return false;
    if (model.IsAtMinimum() || (judges_steps() && model.slope >= 0.0)) {
      d_.setZero();
      model = AlongDirection();
    }
    if (!d_.isZero(0.0) && options.is_auto()) {
      AlongDirection damped = model;
      const double length = d_.norm() / model.unit;
      damped.damping = CurvatureDamping() * length * length;
      if (!AutoStepSize(damped, options.rho, eta, error)) return false;
    }
  }
  *eta *= options.ScheduleFactor(at_x.progress);
  if (judges_steps()) {
    *eta *= control_.step_factor();
    control_.Expect(at_x.cost, model, *eta);
  }
  return true;
}

std::vector<Eigen::VectorXd*> JointRule::MutableState() {
  return {control_.mutable_state()};
}

}  // namespace invgrad
