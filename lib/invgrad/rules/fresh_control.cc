#include "invgrad/rules/fresh_control.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invgrad {
namespace {

// In steps: what would shrink by a factor e in that time is not noise.
constexpr double kHorizon = 1000.0;
// Of the square of the trend in units of its standard error.
constexpr double kSignificance = 0.1;

constexpr double kCautionDown = 0.97;
constexpr double kCautionUp = 1.02;
constexpr double kMinCaution = 1e-3;

constexpr int kSpectrumInterval = 5;

constexpr double kBlock = 10.0;
constexpr double kWorseErrors = 3.0;
constexpr double kWorseFactor = 1.6;
// After a return, the lowest mean rises by so many standard errors: it may have
// been luck.
constexpr double kLuck = 0.3;

// Steps of a trial after an outlier; the second half decides.
constexpr double kTrial = 10.0;
// How many times the loss of other weights is harm.
constexpr double kHarm = 2.0;

// NaN counts as infinite.
double OrInfinity(double cost) {
  return std::isnan(cost) ? std::numeric_limits<double>::infinity() : cost;
}

}  // namespace

void FreshControlOptions::Describe(OptionSet* set) {
  set->Add("without",
           &without,
           {"nothing", "noise", "caution", "returns"},
           "the part of control=fresh that is off");
}

Eigen::VectorXd FreshControl::InitialState() {
  Eigen::VectorXd state = Eigen::VectorXd::Zero(kSize);
  state[kCaution] = 1.0;
  state[kSignalExponent] = 1.0;
  state[kLowest] = std::numeric_limits<double>::max();
  return state;
}

FreshControl::Verdict FreshControl::Judge(double cost, OtherWeights* others) {
  if (!std::isfinite(cost)) return GoBack(others);
  if (state_[kTrialSteps] > 0.0) return JudgeTrial(cost, others);
  const double log_cost = std::log(std::max(cost, 1e-300));
  state_[kBlockSize] += 1.0;
  state_[kBlockSum] += log_cost;
  state_[kBlockSum2] += log_cost * log_cost;
  const bool is_outlier = trend_.known() && trend_.IsOutlier(cost);
  const Verdict verdict = state_[kBlockSize] < kBlock
                              ? Verdict::kGoOn
                              : JudgeBlock(/*may_copy=*/!is_outlier);
  if (options_.without == "returns") {
    Accept(cost);
    return Verdict::kGoOn;
  }
  if (verdict == Verdict::kUndoToCopy) return Return(others->CostAtCopy());
  if (is_outlier) return JudgeOutlier(cost, others);
  Accept(cost);
  return verdict;
}

FreshControl::Verdict FreshControl::JudgeOutlier(double cost,
                                                 OtherWeights* others) {
  const double before = OrInfinity(others->CostBeforeLastStep());
  const double at_copy = OrInfinity(others->CostAtCopy());
  if (std::min(before, at_copy) > cost / kHarm) {
    Accept(cost);
    return Verdict::kGoOn;
  }
  state_[kTrialSteps] = 1.0;
  state_[kTrialSum] = 0.0;
  return before < at_copy ? Verdict::kCopyBefore : Verdict::kGoOn;
}

FreshControl::Verdict FreshControl::JudgeTrial(double cost,
                                               OtherWeights* others) {
  state_[kTrialSteps] += 1.0;
  if (state_[kTrialSteps] <= 0.5 * kTrial + 1.0) return Verdict::kGoOn;
  const double at_copy = OrInfinity(others->CostAtCopy());
  state_[kTrialSum] +=
      std::log(std::max(cost, 1e-300)) - std::log(std::max(at_copy, 1e-300));
  if (state_[kTrialSteps] <= kTrial) return Verdict::kGoOn;
  state_[kTrialSteps] = 0.0;
  if (state_[kTrialSum] > 0.5 * kTrial * std::log(kHarm))
    return Return(at_copy);
  trend_.Restart();
  return Verdict::kGoOn;
}

FreshControl::Verdict FreshControl::GoBack(OtherWeights* others) {
  const double before = OrInfinity(others->CostBeforeLastStep());
  const double at_copy = OrInfinity(others->CostAtCopy());
  if (at_copy < before) return Return(at_copy);
  state_[kTrialSteps] = 0.0;
  ReduceCaution();
  if (!std::isfinite(before)) return Verdict::kLeaveOut;
  Accept(before);
  return Verdict::kUndoStep;
}

FreshControl::Verdict FreshControl::Return(double cost) {
  state_[kTrialSteps] = 0.0;
  ReduceCaution();
  trend_.Restart();
  if (std::isfinite(cost)) Accept(cost);
  return Verdict::kUndoToCopy;
}

FreshControl::Verdict FreshControl::JudgeBlock(bool may_copy) {
  const double mean = state_[kBlockSum] / kBlock;
  // Of the mean; never zero, so that equal losses compare.
  const double variance =
      std::max(0.0, state_[kBlockSum2] / kBlock - mean * mean) /
          (kBlock - 1.0) +
      1e-6;
  state_[kBlockSize] = state_[kBlockSum] = state_[kBlockSum2] = 0.0;
  double& lowest = state_[kLowest];
  double& lowest_variance = state_[kLowestVariance];
  if (mean > lowest + kWorseErrors * std::sqrt(variance + lowest_variance) +
                 std::log(kWorseFactor)) {
    lowest += kLuck * std::sqrt(lowest_variance);
    return Verdict::kUndoToCopy;
  }
  if (!may_copy || mean > lowest + std::sqrt(lowest_variance)) {
    return Verdict::kGoOn;
  }
  lowest = std::min(lowest, mean);
  lowest_variance = variance;
  return Verdict::kCopy;
}

void FreshControl::ReduceCaution() {
  state_[kCaution] = std::max(kMinCaution, 0.5 * state_[kCaution]);
}

void FreshControl::Accept(double cost) {
  trend_.Add(cost);
  if (!trend_.known() || options_.without == "caution") return;
  const double slope = trend_.slope();
  const double error = trend_.slope_error();
  double& caution = state_[kCaution];
  if (slope > error) {
    caution = std::max(kMinCaution, kCautionDown * caution);
  } else if (slope < -error) {
    caution = std::min(1.0, kCautionUp * caution);
  }
}

void FreshControl::Adjust(SpectralFilter* filter) const {
  if (filter->kappa > 0.5) {
    filter->kappa = 0.5 + caution() * (filter->kappa - 0.5);
  }
  if (!trend_.known() || options_.without == "noise") return;
  filter->noise = state_[kNoise];
  const double decrease = -trend_.slope();
  if (decrease > 0.0) {
    const double errors = decrease / trend_.slope_error();
    filter->noise *=
        std::exp(-kHorizon * decrease - kSignificance * errors * errors);
  }
  filter->signal_exponent = state_[kSignalExponent];
}

bool FreshControl::wants_spectrum() const {
  return std::fmod(state_[kSteps], kSpectrumInterval) == 0.0;
}

void FreshControl::Observe(const Spectrum& spectrum) {
  state_[kSteps] += 1.0;
  if (spectrum.is_empty()) return;
  evidence_.Add(spectrum);
  const Evidence::Model model = evidence_.Fit();
  state_[kNoise] = model.noise;
  state_[kSignalExponent] = model.signal_exponent;
}

std::vector<Eigen::VectorXd*> FreshControl::MutableState() {
  return {evidence_.mutable_state(), trend_.mutable_state(), &state_};
}

}  // namespace invgrad
