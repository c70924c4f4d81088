// Control of a rule's steps by their gain: the decrease of the cost, divided by
// the decrease that the model of step_size.h predicts.
//
//   gain = (L(x) - L(x + step)) / (L(x) - M(step))
//   M(step) = L(x) + g . J step + 1/2 J step . H_L J step,
//   or L(R(y, J step)), if the outputs keep a quantity
//
// A step with gain < 0, or a step that M predicts to be too long and that raises
// the cost, is reverted. The gain then changes the filter for the next step:
//
//   exponent   kappa + 0.02 if gain > 0.85, kappa - 0.05 if gain < 0.4,
//              within [0.3, 1]
//   damping    relative_damping * max(1/3, 1 - (2 gain - 1)^3) if gain > 0, * 4
//              if not, within [1e-14, 100], from 1e-6 if it is 0; `damping`
//              stays as it is
//   both       exponent and damping
//   nothing    neither: steps are only kept or reverted
//
// In all cases a reverted step halves the step size, down to 1e-12 of the
// rule's own, and a kept step doubles the step size, up to the rule's own.
//
// In training, L is the loss of the mini-batch that the step was computed from:
// the gain measures the error of this model over the step, not the effect
// of the step on other samples, which rho limits.
//
// Cost:    one evaluation of the cost a step, and products with J and H_L, or
//          evaluations of the loss on the curve of outputs.
// Source:  the gain ratio is that of trust-region methods (Conn, Gould, Toint.
//          Trust-Region Methods. SIAM 2000, chapter 6), the law for the damping
//          is Nielsen's (Damping Parameter in Marquardt's Method.
//          IMM-REP-1999-05, Technical University of Denmark, section 3), also
//          used by Ceres; on mini-batches: Martens. Deep Learning via
//          Hessian-free Optimization. ICML 2010, section 4.1. Control of the
//          exponent is ours.
#ifndef INVGRAD_RULES_GAIN_CONTROL_H_
#define INVGRAD_RULES_GAIN_CONTROL_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/option_set.h"
#include "invgrad/rules/step_size.h"
#include "invgrad/spectral.h"

namespace invgrad {

struct GainControlOptions {
  std::string control = "none";
  std::string adapts = "exponent";

  void Describe(OptionSet* set);

  bool is_on() const { return control != "none"; }
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

  // Call before a step of size eta along the direction of the model.
  void Expect(double cost, const AlongDirection& model, double eta);

  // Call after this step, or after `fraction` of it, with the new cost (NaN if
  // not finite). Returns false if the step must be reverted.
  bool Judge(double cost, double fraction);

  double last_gain() const { return last_gain_; }

  // kappa, relative damping, step factor.
  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  void Adapt(double gain);
  void GrowStep();

  const GainControlOptions options_;
  const SpectralFilter filter_;
  Eigen::VectorXd state_;

  // Arguments of Expect.
  double cost_ = 0.0;
  AlongDirection model_;
  double eta_ = 0.0;
  double last_gain_ = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_GAIN_CONTROL_H_
