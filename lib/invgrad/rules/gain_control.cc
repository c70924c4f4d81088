#include "invgrad/rules/gain_control.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invgrad {
namespace {

constexpr double kHighGain = 0.85;
constexpr double kLowGain = 0.4;

constexpr double kExponentUp = 0.02;
constexpr double kExponentDown = 0.05;
constexpr double kMinExponent = 0.3;
constexpr double kMaxExponent = 1.0;

constexpr double kDampingUp = 4.0;
constexpr double kDampingDown = 1.0 / 3.0;
constexpr double kFirstDamping = 1e-6;
constexpr double kMinDamping = 1e-14;
constexpr double kMaxDamping = 100.0;

// From this factor, 40 doublings lead back to the full step.
constexpr double kMinStepFactor = 1e-12;

// Relative changes of the cost below this are rounding.
constexpr double kRounding = 1e-13;

}  // namespace

void GainControlOptions::Describe(OptionSet* set) {
  set->Add("control",
           &control,
           {"none", "gain"},
           "gain: a step whose batch gets worse is undone, and `adapts` "
           "follows the gain");
  set->Add("adapts",
           &adapts,
           {"nothing", "exponent", "damping", "both"},
           "what the gain changes: kappa, relative_damping");
}

GainControl::GainControl(const GainControlOptions& options,
                         const SpectralFilter& filter)
    : options_(options), filter_(filter), state_(3) {
  const bool has_no_damping =
      options.adapts_damping() && filter.relative_damping == 0.0;
  state_ << filter.kappa,
      has_no_damping ? kFirstDamping : filter.relative_damping, 1.0;
}

SpectralFilter GainControl::filter() const {
  SpectralFilter adapted = filter_;
  if (options_.adapts_exponent()) adapted.kappa = state_[0];
  if (options_.adapts_damping()) adapted.relative_damping = state_[1];
  return adapted;
}

void GainControl::Expect(double cost, const AlongDirection& model, double eta) {
  cost_ = cost;
  model_ = model;
  eta_ = eta;
}

bool GainControl::Judge(double cost, double fraction) {
  const double predicted = -model_.Change(fraction * eta_);
  const double decrease = cost_ - cost;
  const double rounding = kRounding * std::abs(cost_);
  constexpr double kWorst = -std::numeric_limits<double>::infinity();
  if (!std::isfinite(cost)) {
    last_gain_ = kWorst;
  } else if (predicted > rounding) {
    last_gain_ = decrease / predicted;
  } else {
    last_gain_ = decrease >= -rounding ? 1.0 : kWorst;
    if (last_gain_ == 1.0) {
      // This says nothing about the model, but the next batch may allow a
      // larger step.
      GrowStep();
      return true;
    }
  }
  Adapt(last_gain_);
  return last_gain_ >= 0.0;
}

void GainControl::Adapt(double gain) {
  double& kappa = state_[0];
  double& damping = state_[1];
  double& step_factor = state_[2];
  if (gain > kHighGain) {
    kappa = std::max(kappa, std::min(kappa + kExponentUp, kMaxExponent));
  } else if (gain < kLowGain) {
    kappa = std::min(kappa, std::max(kappa - kExponentDown, kMinExponent));
  }
  const double factor =
      gain > 0.0 ? std::max(kDampingDown, 1.0 - std::pow(2.0 * gain - 1.0, 3))
                 : kDampingUp;
  damping = std::clamp(
      std::max(damping, kMinDamping) * factor, kMinDamping, kMaxDamping);
  if (gain < 0.0) {
    step_factor = std::max(0.5 * step_factor, kMinStepFactor);
  } else {
    GrowStep();
  }
}

void GainControl::GrowStep() { state_[2] = std::min(2.0 * state_[2], 1.0); }

}  // namespace invgrad
