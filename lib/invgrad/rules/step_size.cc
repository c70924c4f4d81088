#include "invgrad/rules/step_size.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/core/finite.h"

namespace invgrad {

void StepSizeOptions::Describe(bool allow_auto, OptionSet* set) {
  const Range positive{0.0, std::numeric_limits<double>::infinity(), true};
  if (allow_auto) {
    set->Add("step_size",
             &step_size,
             positive,
             "eta; auto: rho times the minimizer of the linear model along the "
             "direction");
  } else {
    CHECK(!is_auto()) << "This rule has no automatic step size.";
    set->Add("step_size", &*step_size, positive, "eta");
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
  return *step_size * ScheduleFactor(progress);
}

bool ModelAlong(const Linearization& at_x,
                const Eigen::VectorXd& direction,
                AlongDirection* model,
                std::string* error) {
  Eigen::VectorXd w;
  CHECK(at_x.jacobian != nullptr) << "The linear model needs J.";
  at_x.jacobian->Times(direction, &w);
  if (!CheckFinite("J d", w, error)) return false;
  model->unit = w.lpNorm<Eigen::Infinity>();
  if (model->unit == 0.0) {
    *error = "J d = 0, so the linear model has no minimizer";
    return false;
  }
  w /= model->unit;
  model->slope = at_x.loss_gradient.dot(w);
  model->squared_length = w.squaredNorm();
  model->curvature = model->squared_length;
  model->squared_hessian_length = model->squared_length;
  if (at_x.loss_hessian_times) {
    const Eigen::VectorXd curved = at_x.loss_hessian_times(w);
    model->curvature = w.dot(curved);
    model->squared_hessian_length = curved.squaredNorm();
  }
  return true;
}

bool AutoStepSize(const AlongDirection& model,
                  double rho,
                  double* step_size,
                  std::string* error) {
  const double eta = -rho * model.slope / model.curvature / model.unit;
  const double slope = model.slope * model.unit;
  const double curvature = model.curvature * model.unit * model.unit;
  // Written so that NaN fails.
  if (!(model.slope < 0.0)) {
    *error = fmt::format(
        "step_size=auto: not a descent direction, slope {:.6g}", slope);
  } else if (!(model.curvature > 0.0)) {
    *error = fmt::format(
        "step_size=auto: the loss does not curve upwards along the direction, "
        "curvature {:.6g}",
        curvature);
  } else if (!std::isfinite(eta)) {
    *error = fmt::format(
        "step_size=auto: not finite: slope {:.6g}, curvature {:.6g}",
        slope,
        curvature);
  } else {
    *step_size = eta;
    return true;
  }
  return false;
}

}  // namespace invgrad
