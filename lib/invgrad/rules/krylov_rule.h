// The power rule in a Krylov space, for a J that is too large to factorize.
//
//   step = -eta V_k R_k^(-kappa) P_k^T g
//
// where k Golub-Kahan iterations from J^T g give J V_k = P_k R_k and
// R_k^(-kappa) = Y S^(-kappa) X^T from the SVD R_k = X S Y^T (golub_kahan.h).
// k = 1 is gradient descent with a scaled step, k = rank J the power rule. For
// k in between, the mean curvature scales all unresolved modes: k acts as a
// truncation.
//
// Shapes:  g: m;  J: m x n;  step: n;  P_k: m x k;  V_k: n x k;  R_k: k x k.
// Units:   as for the power rule: (g, J) -> c (g, J) multiplies the step by
//          c^(1 - kappa), for any k.
// Cost:    k products with J and k with J^T, 2 min(m, n) k^2 for orthogonality,
//          O(k^3); min(m, n) k doubles. Neither J nor its Gram matrix is
//          formed.
// Fails:   as golub_kahan.h, and if there is no automatic step size. Incomplete
//          convergence to the step of the power rule is not a failure.
//
// With a truncation, the iteration ends when the step agrees with the step of
// the truncated power rule to `tolerance`, or after `iterations`.
//
// kappa = 1 is Gauss-Newton with the k-th iterate of LSQR [1].
//
// [1] Paige, Saunders. LSQR: An Algorithm for Sparse Linear Equations and
//     Sparse Least Squares. ACM TOMS 8 (1982).
#ifndef INVGRAD_RULES_KRYLOV_RULE_H_
#define INVGRAD_RULES_KRYLOV_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/spectral/golub_kahan.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

class KrylovRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    Options();

    int iterations = 40;
    double tolerance = 1e-2;

    void Describe(OptionSet* set);
  };

  explicit KrylovRule(const Options& options);

  std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const override;

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        Eigen::VectorXd* direction,
                        std::string* report,
                        std::string* error) override;

  GolubKahanOptions golub_kahan_options_;
  Eigen::MatrixXd basis_;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_KRYLOV_RULE_H_
