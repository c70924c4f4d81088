// Control of a rule by the loss of new samples: how much of the residual is
// noise, how bold the steps are, and when to go back.
//
// A batch is new before its own step; its loss L judges the steps before. From
// the trend of log L (loss_trend.h), d = -slope and its standard error e:
//
//   noise    if d > 0, the filter's noise is exp(-1000 d - 0.1 (d / e)^2) times
//            that of the evidence (evidence.h), else equal to it: a residual that
//            still shrinks, and shrinks for sure, is not noise
//   caution  * 0.97 if d < -e, * 1.02 if d > e, within [1e-3, 1]; it multiplies
//            the step size, and kappa - 1/2 where kappa > 1/2
//   copy     of the weights, after each block of 10 steps whose mean log L is at
//            most one standard error above the lowest one
//   return   to this copy, after a block whose mean is above the lowest one by 3
//            standard errors and log 1.6
//   trial    after an outlier above the trend, if the loss of its batch is at
//            most half as large before the last step or at the copy. The better
//            ones of these weights are the copy then, and ten steps follow. A
//            return ends them if their second half has, by geometric means,
//            twice the loss that the copy has on the same batches.
//   revert   if L is not finite: the last step, or all of them since the copy,
//            where the loss is lower. A batch whose loss is finite nowhere is left
//            out.
//
// Each of the last three, which put earlier weights back, halves the caution and, as a rejected step,
// the step size; kappa falls to 1/2 at most, but for one reverted step.
//
// The setting `without` turns off noise, caution (but for returns) or returns
// (copies and comparisons, too), to measure what each of them does.
//
// Without new samples (all samples in each batch, ceres::Solve) nothing of this
// happens, and gain control is all.
//
// Cost:    the spectrum in every fifth step, a fit to it, and for outliers two
//          evaluations of the loss.
// Source:  ours; numbers and what else was tried: docs/results/control.md.
#ifndef INVGRAD_RULES_FRESH_CONTROL_H_
#define INVGRAD_RULES_FRESH_CONTROL_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/option_set.h"
#include "invgrad/rules/evidence.h"
#include "invgrad/rules/loss_trend.h"
#include "invgrad/spectral.h"
#include "invgrad/update_rule.h"

namespace invgrad {

struct FreshControlOptions {
  std::string without = "nothing";  // the part that is off

  void Describe(OptionSet* set);
};

class FreshControl {
 public:
  using Verdict = StepJudge::Verdict;
  using OtherWeights = StepJudge::OtherWeights;

  explicit FreshControl(const FreshControlOptions& options)
      : options_(options) {}

  // As StepJudge::JudgeWeights.
  Verdict Judge(double cost, OtherWeights* others);

  // Before the filter is applied: kappa follows the caution, noise the trend.
  void Adjust(SpectralFilter* filter) const;
  double caution() const { return state_[kCaution]; }

  // Whether the next step is to measure its spectrum.
  bool wants_spectrum() const;
  // Call after each step, with an empty spectrum if it was not measured.
  void Observe(const Spectrum& spectrum);

  std::vector<Eigen::VectorXd*> MutableState();

 private:
  enum {
    kCaution,
    kSteps,
    kNoise,
    kSignalExponent,
    kBlockSize,
    kBlockSum,
    kBlockSum2,
    kLowest,
    kLowestVariance,
    kTrialSteps,
    kTrialSum,
    kSize
  };

  void Accept(double cost);
  void ReduceCaution();
  // Of an outlier, of a step of a trial, and of a loss that is not finite.
  Verdict JudgeOutlier(double cost, OtherWeights* others);
  Verdict JudgeTrial(double cost, OtherWeights* others);
  Verdict GoBack(OtherWeights* others);
  // Goes on from the copy, where the loss of the batch is `cost`.
  Verdict Return(double cost);
  // Of a full block, which begins anew.
  Verdict JudgeBlock(bool may_copy);

  const FreshControlOptions options_;
  Evidence evidence_;
  LossTrend trend_;
  Eigen::VectorXd state_ = InitialState();
  static Eigen::VectorXd InitialState();
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_FRESH_CONTROL_H_
