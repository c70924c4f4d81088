#include "invgrad/rules/step_size.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "glog/logging.h"
#include "invgrad/linalg/finite.h"

namespace invgrad {

void StepSizeOptions::Describe(bool allow_auto, OptionSet* set) {
  const Range positive{0.0, std::numeric_limits<double>::infinity(), true};
  if (allow_auto) {
    set->AddNumberOrAuto("step_size",
                         &step_size,
                         positive,
                         "eta; auto: rho times the minimizer of the linear "
                         "model along the direction");
  } else {
    set->Add("step_size", &step_size, positive, "eta");
  }
  set->Add("schedule",
           &schedule,
           {"constant", "linear", "cosine", "exponential"},
           "how the step size falls over the budget");
  set->Add("final_fraction",
           &final_fraction,
           {0.0, 1.0, true},
           "step size at the end of the schedule, as a fraction");
  if (allow_auto) {
    set->Add(
        "rho", &rho, {0.0, 2.0, true, true}, "fraction for step_size=auto");
  }
}

double StepSizeOptions::ScheduleFactor(double progress) const {
  constexpr double kPi = 3.14159265358979323846;
  const double p = std::clamp(progress, 0.0, 1.0);
  const double f = final_fraction;
  if (schedule == "linear") return 1.0 - (1.0 - f) * p;
  if (schedule == "cosine") {
    return f + (1.0 - f) * 0.5 * (1.0 + std::cos(kPi * p));
  }
  if (schedule == "exponential") return std::pow(f, p);
  CHECK_EQ(schedule, "constant");
  return 1.0;
}

double StepSizeOptions::Scheduled(double progress) const {
  CHECK(!is_auto()) << "An automatic step size depends on the direction.";
  return step_size * ScheduleFactor(progress);
}

bool AutoStepSize(const Linearization& at_x,
                  const Eigen::VectorXd& direction,
                  double rho,
                  double* step_size,
                  std::string* error) {
  Eigen::VectorXd Jd;
  CHECK(at_x.jacobian != nullptr) << "An automatic step size needs J.";
  at_x.jacobian->Times(direction, &Jd);
  if (!CheckFinite("J d", Jd, error)) return false;
  const double unit = Jd.lpNorm<Eigen::Infinity>();
  if (unit == 0.0) {
    *error = "step_size=auto: J d = 0, so the linear model has no minimizer";
    return false;
  }
  // In units of J d, whose squares could over- or underflow.
  Jd /= unit;
  const Eigen::VectorXd curved =
      at_x.loss_hessian_times ? at_x.loss_hessian_times(Jd) : Jd;
  const double slope = at_x.loss_gradient.dot(Jd);
  const double curvature = Jd.dot(curved);
  const double eta = -rho * slope / curvature / unit;
  std::ostringstream message;
  message << "step_size=auto: ";
  // Written so that NaN fails.
  if (!(slope < 0.0)) {
    message << "not a descent direction, slope " << slope * unit;
  } else if (!(curvature > 0.0)) {
    message << "the loss does not curve upwards along the direction, curvature "
            << curvature * unit * unit;
  } else if (!std::isfinite(eta)) {
    message << "not finite: slope " << slope * unit << ", curvature "
            << curvature * unit * unit;
  } else {
    *step_size = eta;
    return true;
  }
  *error = message.str();
  return false;
}

bool ScaleToStep(const StepSizeOptions& options,
                 const Linearization& at_x,
                 const Eigen::VectorXd& direction,
                 double* eta,
                 Eigen::VectorXd* step,
                 std::string* error) {
  *eta = options.step_size;
  if (direction.isZero(0.0)) {
    // Along it there is nothing to minimize; it is a step of any size.
    *eta = 1.0;
  } else if (options.is_auto() &&
             !AutoStepSize(at_x, direction, options.rho, eta, error)) {
    return false;
  }
  *eta *= options.ScheduleFactor(at_x.progress);
  *step = *eta * direction;
  return CheckFinite("the step", *step, error);
}

}  // namespace invgrad
