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
// The iteration ends when the step agrees with the step of the truncated power
// rule to `tolerance`, or after `iterations`. Without a truncation the values
// beyond the rank of J, which are rounding errors, would be inverted, too.
//
// kappa = 1 is Gauss-Newton with the k-th iterate of LSQR [1].
//
// [1] Paige, Saunders. LSQR: An Algorithm for Sparse Linear Equations and
//     Sparse Least Squares. ACM TOMS 8 (1982).
#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/spectral/golub_kahan.h"

namespace invgrad {
namespace {

class KrylovRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    GolubKahanOptions golub_kahan{/*tolerance=*/1e-2, /*max_iterations=*/40};

    Options() {
      step_size.step_size = std::nullopt;  // auto
    }
    void Describe(OptionSet* set) {
      JointRule::Options::Describe(set);
      set->Add("iterations",
               &golub_kahan.max_iterations,
               {1.0, 1e5},
               "k: products with J and with J^T for a step, at most");
      set->Add("tolerance",
               &golub_kahan.tolerance,
               {0.0, std::numeric_limits<double>::infinity(), true},
               "estimated relative error at which a truncated step is done");
    }
  };

  explicit KrylovRule(const Options& options)
      : JointRule(options), options_(options.golub_kahan) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = JointRule::Needs();
    parts.num_products = 2 * options_.max_iterations;
    return parts;
  }

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        Eigen::VectorXd* direction,
                        std::string* report,
                        std::string* error) override {
    GolubKahanSummary summary;
    if (!GolubKahanStep(*at_x.jacobian,
                        at_x.loss_gradient,
                        filter,
                        options_,
                        &basis_,
                        direction,
                        &summary)) {
      *error = summary.message;
      return false;
    }
    *report = fmt::format("{} iterations", summary.num_iterations);
    if (summary.s_max > 0.0) {
      *report += fmt::format(", {} values down to {:.2g} s_max",
                             summary.rank,
                             summary.s_min_kept / summary.s_max);
    }
    return true;
  }

  const GolubKahanOptions options_;
  Eigen::MatrixXd basis_;
};

}  // namespace

std::vector<RuleRow> KrylovRuleRows() {
  return {MakeRuleRow<KrylovRule>(
      "krylov",
      "step = -eta V_k R_k^(-kappa) P_k^T g, k Golub-Kahan iterations")};
}

}  // namespace invgrad
