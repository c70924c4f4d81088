// The step size eta of a rule: fixed, scheduled, or found from a model of the
// loss along the direction.
//
//   fixed      eta
//   schedule   eta s(p), p in [0, 1] the share of the budget that is spent:
//              constant     s = 1
//              linear       s = 1 - (1 - f) p
//              cosine       s = f + (1 - f) (1 + cos(pi p)) / 2
//              exponential  s = f^p
//              with f = final_fraction
//   auto       eta s(p) with eta = rho times the minimizer of a model of the loss
//              along d. The linear model is the rule:
//
//     L + eta g . J d + eta^2/2 J d . H_L J d,   eta = -(g . J d)/(J d . H_L J d)
//
//              If the outputs keep a quantity (Loss::has_invariant), it is the
//              loss itself on a curve of outputs that keep it,
//
//     L(R(y, J d, eta)),
//
//              and eta its first local minimum, at most half a turn of the
//              fastest sample.
//
// An infidelity 1 - |<y*|y>|^2 needs the curve: its H_L is negative, and what
// curves the loss upwards is that |y| stays 1.
//
// Units:   eta has the units of step / d, so `auto` makes a rule's step
//          independent of the units of the loss.
// Cost:    auto: one product with J and one with H_L, or some 20 gradients of the
//          loss in y on the curve.
// Fails:   ModelAlong returns false if J d is zero or not finite. AutoStepSize
//          returns false if d is no descent direction, if the linear model does
//          not curve upwards along J d, or if a value is not finite.
#ifndef INVGRAD_RULES_STEP_SIZE_H_
#define INVGRAD_RULES_STEP_SIZE_H_

#include <functional>
#include <optional>
#include <string>

#include "Eigen/Core"
#include "invgrad/linearization.h"
#include "invgrad/option_set.h"

namespace invgrad {

struct StepSizeOptions {
  std::optional<double> step_size = 1.0;  // eta > 0; no value: auto
  std::string schedule = "constant";
  double final_fraction = 0.01;  // f in (0, 1]
  double rho = 0.3;              // in (0, 2), for auto

  // Adds step_size, schedule and final_fraction. With `allow_auto`, for rules
  // that use J, step_size may be "auto", and rho is added.
  void Describe(bool allow_auto, OptionSet* set);

  bool is_auto() const { return !step_size.has_value(); }
  bool has_schedule() const { return schedule != "constant"; }

  // s(progress).
  double ScheduleFactor(double progress) const;

  // eta s(progress). CHECKs that it is not auto.
  double Scheduled(double progress) const;
};

// The model of the loss along a direction d. The largest entry of w = J d / unit
// is one, so that no square over- or underflows.
//
//   change(eta) = L(R(y, w, a)) - L(y) + a^2/2 damping,   a = eta unit,
//   or, without a curve, a slope + a^2/2 (curvature + damping)
struct AlongDirection {
  double unit = 0.0;       // |J d|_inf
  double slope = 0.0;      // g . w
  double steepest = 0.0;   // |g| |w|
  double curvature = 0.0;  // w . H_L w; 0 if there is a curve
  double damping = 0.0;    // a rule's own addition
  // a -> the loss at R(y, w, a). Empty: the linear model.
  std::function<LossOnCurve(double a)> curve;
  LossOnCurve start;  // curve(0)

  // The predicted change of the loss.
  double Change(double eta) const;
  // Whether a direction of descent has a slope that is not negative because it is
  // rounding: the loss has a minimum here, at least along the directions that a
  // rule takes.
  bool IsAtMinimum() const;
};

bool ModelAlong(const Linearization& at_x,
                const Eigen::VectorXd& direction,
                AlongDirection* model,
                std::string* error);

// The automatic step size, without the factor of the schedule.
bool AutoStepSize(const AlongDirection& model,
                  double rho,
                  double* step_size,
                  std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RULES_STEP_SIZE_H_
