// Control of a rule's steps by their gain: how much of the decrease of the
// cost that the quadratic model promised has come.
//
//   gain = (L(x) - L(x + step)) / (L(x) - M(step))
//   M(step) = L(x) + g . J step + 1/2 J step . H_L J step
//
// A step with gain < 0 is taken back, and so is one of which nothing was
// promised (because it goes too far already for M) if the cost has risen. What
// the gain changes for the next step:
//
//   exponent   kappa + 0.02 if gain > 0.85, kappa - 0.05 if gain < 0.4,
//              within [0.3, 1]
//   damping    relative_damping * max(1/3, 1 - (2 gain - 1)^3) if gain > 0, * 4
//              if not, within [1e-14, 100], from 1e-6 if it is 0; `damping`
//              stays as it is
//   both       the two of them
//   nothing    neither: steps are accepted or taken back
//
// Whatever it is, a step that is taken back halves the step size, down to 1e-12
// of the rule's own, and one that is kept doubles it, up to that. (The next
// step may be computed from the same point, where nothing else would change.)
//
// In training, x and L are those of the mini-batch that the step was computed
// from: the gain tells whether the linear model holds over the step, not
// whether the step is good for other samples. That is left to rho.
//
// If the loss does not curve upwards along J step (an infidelity, whose H_L is
// negative), M has h |J step|^2 in place of J step . H_L J step, where h is
// measured: the curvature that explains the cost after the last step, which may
// change by a factor of 4 a step, from |H_L J step| / |J step| at first. With
// it step_size=auto works for such losses too.
//
// Cost:    one evaluation of the cost a step, and products with J and H_L.
// Source:  the gain ratio is that of trust-region methods (Conn, Gould, Toint.
//          Trust-Region Methods. SIAM 2000, chapter 6), the law for the damping
//          Nielsen's (Damping Parameter in Marquardt's Method. IMM-REP-1999-05,
//          Technical University of Denmark, section 3), which is Ceres' too; on
//          mini-batches: Martens. Deep Learning via Hessian-free Optimization.
//          ICML 2010, section 4.1. Control of the exponent is ours.
#ifndef INVGRAD_RULES_GAIN_CONTROL_H_
#define INVGRAD_RULES_GAIN_CONTROL_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/rules/step_size.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

struct GainControlOptions {
  std::string control = "none";
  std::string adapts = "exponent";

  void Describe(OptionSet* set);

  bool is_on() const { return control == "gain"; }
  bool adapts_exponent() const {
    return adapts == "exponent" || adapts == "both";
  }
  bool adapts_damping() const {
    return adapts == "damping" || adapts == "both";
  }
};

class GainControl {
 public:
  GainControl(const GainControlOptions& options, const SpectralFilter& filter);

  // The filter and the factor of the step size for the next step.
  SpectralFilter filter() const;
  double step_factor() const { return state_[2]; }

  // Gives the model its curvature if the loss has none.
  void CompleteModel(AlongDirection* model);

  // Before a step of size eta along the model's direction.
  void Expect(double cost, const AlongDirection& model, double eta);

  // After that step, or `fraction` of it, with the cost where it led (NaN: it
  // has no finite value). False: the step is to be taken back.
  bool Judge(double cost, double fraction);

  double last_gain() const { return last_gain_; }

  // What the next step depends on: kappa, relative damping, step factor, h (0:
  // not known yet).
  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  void MeasureCurvature(double decrease, double eta);
  void Adapt(double gain);
  void GrowStep();

  const GainControlOptions options_;
  const SpectralFilter filter_;
  Eigen::VectorXd state_;

  // What is expected.
  double cost_ = 0.0;
  AlongDirection model_;
  double eta_ = 0.0;
  double last_gain_ = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_GAIN_CONTROL_H_
