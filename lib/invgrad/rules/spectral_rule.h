// Applies a spectral filter of J to the loss gradient: of all of J, or of the
// columns of one layer at a time.
//
//   step = -eta V phi(S) U^T g,             J = U S V^T,   g = dL/dy
//   step_l = -eta V_l phi(S_l) U_l^T g,     J_l = U_l S_l V_l^T    (layerwise)
//
//   row                   phi(s)
//   power                 s^-kappa           for s > truncation s_max, else 0
//   half_inverse          s^(-1/2)           for s > truncation s_max, else 0
//   gauss_newton          s^-1               for s > truncation s_max, else 0
//   levenberg_marquardt   s / (s^2 + damping + relative_damping s_max^2)
//   layer_half_inverse    layerwise: s^-kappa for s > truncation s_max of J_l,
//                         else 0; kappa is 1/2 by default
//   adaptive_power        s^-kappa for s > truncation s_max, else 0; kappa
//                         starts at 1/2 and follows the gain (gain_control.h),
//                         and the step size is automatic: no setting is needed
//
// These are the defaults of the rows. Every row has the settings truncation and
// damping of the filter s (s^2 + lambda)^(-(1 + kappa) / 2)
// (spectral_filter.h). With control=gain, kappa, lambda or both follow the gain
// and start from the row's values.
//
// The J_l are the ColumnBlocks of J: a network's layers, or the parameter
// blocks of a ceres::Problem that are not constant. The rule neglects the
// coupling between blocks: if each of L layers can correct the outputs, the sum
// of their full steps (kappa = 1) overshoots L times. If J has no ColumnBlocks,
// J is the only block.
//
// Shapes:  g: m;  J: m x n;  step: n.
// Units:   (g, J) -> c (g, J) multiplies the step by c^(1 - kappa): the
//          half-inverse step depends on the units of y, on a factor 1/2 in the
//          loss, and on sum or mean over a batch. g is used as it is given.
//          damping has the units of s^2.
// Cost:    one spectral step, see spectral_step.h; step_size=auto adds two
//          products. Layerwise: one step for each layer, of size min(m, n_l).
//          This is cheaper than the joint step if most layers have n_l < m
//          (large batches): n_l^3 each instead of min(m, n)^3. For n_l >= m it
//          is L times the work.
// Fails:   returns false if g, J or the step is not finite, if a factorization
//          does not converge, or if there is no automatic step size.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022. arXiv 2203.10131. Its eta is 1 for the oscillators.
#ifndef INVGRAD_RULES_SPECTRAL_RULE_H_
#define INVGRAD_RULES_SPECTRAL_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/spectral/spectral_filter.h"
#include "invgrad/spectral/spectral_step.h"

namespace invgrad {

class SpectralRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    // The settings of the rows.
    static Options Power();
    static Options HalfInverse();
    static Options GaussNewton();
    static Options LevenbergMarquardt();
    static Options LayerHalfInverse();
    static Options AdaptivePower();

    bool layerwise = false;
    std::string route = "auto";
    // Bound on the error estimate, which is at least 20 times the error for the
    // Jacobians of the problems (docs/results/accuracy.md). Training does not
    // depend on this bound: see docs/results/speed.md.
    double tolerance = 1e-2;
    // A value within a quarter of the threshold may be kept or dropped; tau is
    // rarely known more precisely.
    double threshold_tolerance = 0.25;

    void Describe(OptionSet* set);
  };

  explicit SpectralRule(const Options& options);

  // Includes the routes' histories, which choose the next step's routes.
  std::vector<Eigen::VectorXd*> MutableState() override;
  std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const override;

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        Eigen::VectorXd* direction,
                        std::string* report,
                        std::string* error) override;

  const bool layerwise_;
  SpectralStepOptions spectral_options_;
  SpectralWorkspace workspace_;
  Eigen::VectorXd histories_;  // one per block, zero before the first step
  Eigen::VectorXd d_;          // of a block
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_SPECTRAL_RULE_H_
