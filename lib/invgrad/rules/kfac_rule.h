// A half-inverse step for each layer of a network, with K-FAC's approximation
// of J_l^T J_l: two small eigenproblems for each layer instead of one for J.
//
//   J_l^T J_l = sum_s D_s (x) a_s a_s^T ~ (1 / B) D (x) A,
//   A = sum_s a_s a_s^T = P diag(lambda) P^T,
//   D = sum_s D_s = Q diag(mu) Q^T,   D_s = sum_j delta_{s,j} delta_{s,j}^T
//
//   step_l = -eta P [phi(s_ik) / s_ik * (P^T G_l Q)_ik] Q^T,
//   s_ik = sqrt(lambda_i mu_k / B),   phi(s) = s^-kappa for s > tau s_max
//
// so that step_l = -eta B^p A^-p G_l D^-p with p = (1 + kappa) / 2: 3/4 for
// half-inverse, 1 for the Gauss-Newton step of K-FAC [1]. G_l is the gradient
// J_l^T g in the layer's weights as a matrix, a_s and delta_{s,j} the factors
// of layer_jacobian.h, tau and s_max (of each layer) as in spectral_filter.h.
// A value counts as zero if its lambda_i or mu_k is zero up to rounding.
//
// The approximation drops the coupling of the layers and the correlation of D_s
// and a_s a_s^T over the batch. The second is exact for one sample with one
// output, and if all samples have the same D_s (the last layer in front of a
// linear simulator).
//
// Shapes:  A: fan_in x fan_in;  D: fan_out x fan_out;  G_l, step_l: fan_in x
//          fan_out, with the bias in the last row.
// Units:   as half-inverse: (g, J) -> c (g, J) multiplies the step by
//          c^(1 - kappa). A full step in each of L layers overshoots: choose
//          eta smaller than for half_inverse, or auto.
// Cost:    B sum (fan_in^2 + |y| fan_out^2) + O(sum fan_in^3 + fan_out^3), and
//          the deltas of network_jacobian.h; step_size=auto adds one product.
// Fails:   returns false if J has no layers (a network in front of a simulator
//          has; a ceres::Problem has none), if g, J^T g or the step is not
//          finite, if a factorization does not converge, or if there is no
//          automatic step size.
//
// [1] Martens, Grosse. Optimizing Neural Networks with Kronecker-factored
//     Approximate Curvature. ICML 2015, sections 3 and 4.2 (block diagonal).
//     arXiv 1503.05671. In [1], D_s = E[g_z g_z^T] includes the loss, and
//     damping and momentum are added; here the metric of y is the identity, as
//     in every joint rule.
#ifndef INVGRAD_RULES_KFAC_RULE_H_
#define INVGRAD_RULES_KFAC_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

class KfacRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    // Half-inverse. Values below 1e-3 s_max are clamped, similar to K-FAC's
    // damping, not dropped: docs/results/layerwise.md.
    Options();

    void Describe(OptionSet* set);
  };

  explicit KfacRule(const Options& options);

  std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const override;

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        Eigen::VectorXd* direction,
                        std::string* report,
                        std::string* error) override;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_KFAC_RULE_H_
