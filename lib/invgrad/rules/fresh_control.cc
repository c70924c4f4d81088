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

FreshControl::Verdict FreshControl::Judge(double cost) {
  if (!std::isfinite(cost)) return Verdict::kCompare;
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
  if (verdict == Verdict::kReturn) return verdict;
  if (is_outlier) return Verdict::kCompare;
  Accept(cost);
  return verdict;
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
    return Verdict::kReturn;
  }
  if (!may_copy || mean > lowest + std::sqrt(lowest_variance)) {
    return Verdict::kGoOn;
  }
  lowest = std::min(lowest, mean);
  lowest_variance = variance;
  return Verdict::kCopy;
}

void FreshControl::Returned(Return where, double cost) {
  if (where != Return::kNowhere) {
    state_[kCaution] = std::max(kMinCaution, 0.5 * state_[kCaution]);
  }
  if (where == Return::kToCopy) trend_.Restart();
  if (std::isfinite(cost)) Accept(cost);
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
