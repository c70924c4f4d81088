#include "invgrad/rules/step_size.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

namespace {

constexpr double kPi = 3.14159265358979323846;

// The zero of a function between `low`, where it is negative, and `high`, where
// it is not: false position, where the value at an end that stays is halved, so
// that both ends move [1, the Illinois algorithm]. The bracket only shrinks.
//
// [1] Dowell, Jarratt. A modified regula falsi method for computing the root of
//     an equation. BIT 11, 1971.
template <typename Function>
double ZeroBetween(double low,
                   double at_low,
                   double high,
                   double at_high,
                   const Function& function) {
  // So small, because roundings decide which iterate is the last one, and the
  // step must not depend on them. It costs some 3 evaluations more than 1e-3.
  constexpr double kTolerance = 1e-10;
  constexpr int kMaxNumEvaluations = 100;
  int last_side = 0;
  for (int k = 0; k < kMaxNumEvaluations; ++k) {
    const double width = high - low;
    const double zero = high - at_high / (at_high - at_low) * width;
    if (width <= kTolerance * high) return zero;
    const double value = function(zero);
    if (value == 0.0) return zero;
    if (std::isnan(value)) return value;
    const int side = value < 0.0 ? -1 : 1;
    if (side < 0) {
      low = zero;
      at_low = value;
      if (last_side == side) at_high *= 0.5;
    } else {
      high = zero;
      at_high = value;
      if (last_side == side) at_low *= 0.5;
    }
    last_side = side;
  }
  return high;
}

// The a > 0 where the loss on the curve stops falling for the first time, at most
// half a turn of the fastest sample. NaN if the loss is not finite on the way.
double FirstMinimumOnCurve(const AlongDirection& model) {
  // The slope is looked at where the fastest sample has turned by these angles.
  // They double, because a minimum may be near, and the loss of a state has
  // the period pi, so that the spacing must stay a small part of pi.
  constexpr double kFirstAngle = kPi / 1024.0;
  constexpr double kMaxSpacing = kPi / 16.0;
  const auto slope = [&model](double a) {
    return model.curve(a).slope + model.damping * a;
  };
  double low = 0.0;
  double at_low = model.slope;
  for (double angle = kFirstAngle;; angle += std::min(angle, kMaxSpacing)) {
    const double a = std::min(angle, kPi) / model.start.speed;
    const double at_a = slope(a);
    if (std::isnan(at_a)) return at_a;
    if (at_a >= 0.0) return ZeroBetween(low, at_low, a, at_a, slope);
    if (angle >= kPi) return a;
    low = a;
    at_low = at_a;
  }
}

}  // namespace

void StepSizeOptions::Describe(bool allow_auto, OptionSet* set) {
  const Range positive{0.0, std::numeric_limits<double>::infinity(), true};
  if (allow_auto) {
    set->Add("step_size", &step_size, positive, "eta");
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
    set->Add("rho",
             &rho,
             {0.0, 2.0, true, true},
             "with step_size=auto: eta over the minimizer of the model of the "
             "loss along the direction");
  }
}

double StepSizeOptions::ScheduleFactor(double progress) const {
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

double AlongDirection::Change(double eta) const {
  const double a = eta * unit;
  if (curve) return curve(a).loss - start.loss + 0.5 * a * a * damping;
  return a * (slope + 0.5 * a * (curvature + damping));
}

bool AlongDirection::IsAtMinimum() const {
  // J d has few digits if a rule divides by small singular values.
  constexpr double kSmallestCosine = 1e-8;
  return slope >= 0.0 && slope <= kSmallestCosine * steepest;
}

bool ModelAlong(const Linearization& at_x,
                const Eigen::VectorXd& direction,
                AlongDirection* model,
                std::string* error) {
  Eigen::VectorXd w;
  CHECK(at_x.jacobian != nullptr) << "The linear model needs J.";
  at_x.jacobian->Times(direction, &w);
  if (!CheckFinite("J d", w, error)) return false;
  *model = AlongDirection();
  model->unit = w.lpNorm<Eigen::Infinity>();
  if (model->unit == 0.0) {
    *error = "J d = 0, so the linear model has no minimizer";
    return false;
  }
  w /= model->unit;
  model->steepest = at_x.loss_gradient.stableNorm() * w.norm();
  if (at_x.loss_on_curve) {
    model->curve = [loss_on_curve = at_x.loss_on_curve,
                    w = std::move(w)](double a) { return loss_on_curve(w, a); };
    model->start = model->curve(0.0);
    model->slope = model->start.slope;
    return true;
  }
  model->slope = at_x.loss_gradient.dot(w);
  model->curvature = at_x.loss_hessian_times ? w.dot(at_x.loss_hessian_times(w))
                                             : w.squaredNorm();
  return true;
}

bool AutoStepSize(const AlongDirection& model,
                  double rho,
                  double* step_size,
                  std::string* error) {
  const double slope = model.slope * model.unit;
  // Written so that NaN fails.
  if (!(model.slope < 0.0)) {
    *error = fmt::format(
        "step_size=auto: not a descent direction, slope {:.6g}", slope);
    return false;
  }
  if (model.curve) {
    const double eta = rho * FirstMinimumOnCurve(model) / model.unit;
    if (!std::isfinite(eta)) {
      *error = fmt::format(
          "step_size=auto: the loss is not finite along the direction, slope "
          "{:.6g}",
          slope);
      return false;
    }
    *step_size = eta;
    return true;
  }
  const double upwards = model.curvature + model.damping;
  const double eta = -rho * model.slope / upwards / model.unit;
  const double curvature = upwards * model.unit * model.unit;
  if (!(upwards > 0.0)) {
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
