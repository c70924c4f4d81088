// The base class of the rules that filter the singular values of the joint
// Jacobian of network and simulator: filter, step size, and control.
//
//   step = -eta d,   d = V phi(S) U^T g or an approximation,   J = U S V^T
//
// with phi of spectral.h. A derived rule computes d.
//
// Shapes:  g: m;  J: m x n;  step, d: n.
// Cost:    the cost of d; step_size=auto and control add products with J
//          and H_L (step_size.h), control also one evaluation of the cost.
// Fails:   returns false if d cannot be computed, if the step is not finite, or
//          if there is no automatic step size. At a minimum, where the slope
//          along d is rounding, the step is zero.
#ifndef INVGRAD_RULES_JOINT_RULE_H_
#define INVGRAD_RULES_JOINT_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/linearization.h"
#include "invgrad/option_set.h"
#include "invgrad/rules/gain_control.h"
#include "invgrad/rules/step_size.h"
#include "invgrad/spectral.h"
#include "invgrad/update_rule.h"

namespace invgrad {

class JointRule : public UpdateRule, private StepJudge {
 public:
  struct Options {
    StepSizeOptions step_size{1.0};
    SpectralFilter filter = SpectralFilter::HalfInverse(1e-6);
    bool kappa_is_a_setting = true;
    GainControlOptions control;

    void Describe(OptionSet* set);
  };

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.progress = options_.step_size.has_schedule();
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) final;
  StepJudge* judge() final { return judges_steps() ? this : nullptr; }
  std::vector<Eigen::VectorXd*> MutableState() override;
  std::string LastStepReport() const final { return report_; }

 protected:
  explicit JointRule(const Options& options);

  const Options& joint_options() const { return options_; }

  // With control.
  bool judges_steps() const { return options_.control.is_on(); }

  // Computes *direction = d; *report describes the computation. Returns false,
  // with *error, if that fails.
  virtual bool ComputeDirection(const Linearization& at_x,
                                const SpectralFilter& filter,
                                Eigen::VectorXd* direction,
                                std::string* report,
                                std::string* error) = 0;

  // lambda of the automatic step size, which then minimizes the model of the
  // loss with |eta d|^2 lambda / 2 added.
  virtual double CurvatureDamping() const { return 0.0; }

 private:
  bool KeepsStep(double cost, double fraction) final {
    return control_.Judge(cost, fraction);
  }

  // The step size along -d_.
  bool FindStepSize(const Linearization& at_x, double* eta, std::string* error);

  const Options options_;
  GainControl control_;
  Eigen::VectorXd d_;
  std::string report_;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_JOINT_RULE_H_
