#include "invgrad/rules/joint_rule.h"

#include <sstream>

#include "glog/logging.h"
#include "invgrad/core/finite.h"
#include "invgrad/rules/filter_options.h"

namespace invgrad {

void JointRule::Options::DescribeJoint(OptionSet* set) {
  step_size.Describe(/*allow_auto=*/true, set);
  DescribeFilter(&filter, kappa_is_a_setting, set);
  control.Describe(set);
}

JointRule::JointRule(const Options& options)
    : options_(options), control_(options.control, options.filter) {}

LinearizationParts JointRule::Needs() const {
  LinearizationParts parts;
  parts.jacobian = true;
  return parts;
}

bool JointRule::ComputeStep(const Linearization& at_x,
                            Eigen::VectorXd* step,
                            std::string* error) {
  CHECK(at_x.jacobian != nullptr) << "A joint rule needs J.";
  report_.clear();
  const SpectralFilter filter =
      JudgesSteps() ? control_.filter() : options_.filter;
  std::string how;
  if (!ComputeDirection(at_x, filter, &d_, &how, error)) return false;
  double eta = 0.0;
  if (!FindStepSize(at_x, &eta, error)) return false;
  *step = -eta * d_;
  if (!CheckFinite("the step", *step, error)) return false;
  std::ostringstream report;
  report.precision(2);
  report << how;
  if (options_.step_size.is_auto()) report << ", step size " << eta;
  if (JudgesSteps()) {
    report << ", kappa " << filter.kappa << ", damping "
           << filter.relative_damping << " s_max^2";
  }
  report_ = report.str();
  return true;
}

bool JointRule::FindStepSize(const Linearization& at_x,
                             double* eta,
                             std::string* error) {
  const StepSizeOptions& options = options_.step_size;
  *eta = options.is_auto() ? 1.0 : options.step_size;
  // Along a direction of zero there is nothing to minimize; it is a step of any
  // size.
  const bool is_zero = d_.isZero(0.0);
  AlongDirection model;
  if (!is_zero && (options.is_auto() || JudgesSteps())) {
    if (!ModelAlong(at_x, -d_, &model, error)) return false;
    if (JudgesSteps()) {
      control_.CompleteModel(&model);
      // At a minimum, where only roundings of the slope are left.
      if (model.slope >= 0.0) {
        d_.setZero();
        model = AlongDirection();
      }
    }
    if (!d_.isZero(0.0) && options.is_auto() &&
        !AutoStepSize(model, options.rho, eta, error)) {
      if (!JudgesSteps() && model.curvature <= 0.0) {
        *error += "; control=gain measures it";
      }
      return false;
    }
  }
  *eta *= options.ScheduleFactor(at_x.progress);
  if (JudgesSteps()) {
    *eta *= control_.step_factor();
    control_.Expect(at_x.cost, model, *eta);
  }
  return true;
}

bool JointRule::KeepsStep(double cost, double fraction) {
  return control_.Judge(cost, fraction);
}

}  // namespace invgrad
