// Newton's method with the exact Hessian, and its saddle-free form.
//
//   step = -eta H^-1 gradient                              H = d2L/dx2      [1]
//   step = -eta |H|^-1 gradient,   |H| = V |Lambda| V^T    (saddle-free)    [2]
//
// Shapes:  gradient, step: n;  H: n x n.
// Units:   eta is a number: Newton's step does not depend on the units of x or
//          L. The saddle-free step depends on the units of x.
// Cost:    Newton O(n^3 / 3); saddle-free one eigen-decomposition, O(n^3).
// Fails:   returns false if the gradient, H or the step is not finite, or if
//          the eigen-decomposition does not converge.
//
// Newton's method converges to any stationary point, also to saddles and
// maxima. If the equilibrated H is not invertible to working precision
// (reciprocal condition below epsilon, by LAPACK's dsysvx), the step is
// -fallback_step_size gradient, and LastStepReport() reports this.
//
// Saddle-free: curvatures |lambda| <= n epsilon |lambda|_max count as zero. In
// these directions the step is -fallback_step_size gradient.
//
// [1] Holl, Koltun, Thuerey. Scale-invariant Learning by Physics Inversion.
//     NeurIPS 2022. arXiv 2109.15048.
// [2] Dauphin et al. Identifying and attacking the saddle point problem in
//     high-dimensional non-convex optimization. NeurIPS 2014. arXiv 1406.2572.
#include <lapacke.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/equilibration.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

class Newton final : public UpdateRule {
 public:
  struct Options {
    bool saddle_free = false;  // selects the rule; not a setting
    StepSizeOptions step_size{1.0};
    double fallback_step_size = 0.01;  // of gradient descent

    void Describe(OptionSet* set) {
      step_size.Describe(/*allow_auto=*/false, set);
      set->Add("fallback_step_size",
               &fallback_step_size,
               {0.0, std::numeric_limits<double>::infinity(), true},
               "eta of the gradient-descent step where the Hessian is "
               "singular");
    }
  };

  explicit Newton(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Gradient();
    parts.hessian = true;
    parts.progress = options_.step_size.has_schedule();
    return parts;
  }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    CHECK_EQ(at_x.hessian.rows(), at_x.gradient.size());
    CHECK_EQ(at_x.hessian.cols(), at_x.gradient.size());
    report_.clear();
    return CheckFinite("the gradient", at_x.gradient, error) &&
           CheckFinite("the Hessian", at_x.hessian, error) &&
           (options_.saddle_free ? SaddleFreeStep(at_x, step, error)
                                 : NewtonStep(at_x, step, error)) &&
           CheckFinite("the step", *step, error);
  }

  std::string LastStepReport() const override { return report_; }

 private:
  bool NewtonStep(const Linearization& at_x,
                  VectorXd* step,
                  std::string* error) {
    const Index n = at_x.gradient.size();
    const VectorXd scale = EquilibrationOf(at_x.hessian);
    const MatrixXd H = scale.asDiagonal() * at_x.hessian * scale.asDiagonal();
    const VectorXd gradient = scale.cwiseProduct(at_x.gradient);
    MatrixXd factor(n, n);
    std::vector<lapack_int> pivots(n);
    VectorXd solution(n);
    double reciprocal_condition = 0.0;
    double forward_error = 0.0;
    double backward_error = 0.0;
    const lapack_int info = LAPACKE_dsysvx(LAPACK_COL_MAJOR,
                                           'N',
                                           'L',
                                           n,
                                           1,
                                           H.data(),
                                           n,
                                           factor.data(),
                                           n,
                                           pivots.data(),
                                           gradient.data(),
                                           n,
                                           solution.data(),
                                           n,
                                           &reciprocal_condition,
                                           &forward_error,
                                           &backward_error);
    if (info < 0) {
      *error = "the Hessian could not be factorized (dsysvx)";
      return false;
    }
    const double schedule = options_.step_size.ScheduleFactor(at_x.progress);
    if (info == 0) {
      *step = -*options_.step_size.step_size * schedule *
              scale.cwiseProduct(solution);
      report_ = fmt::format("Newton step, reciprocal condition {:.6g}",
                            reciprocal_condition);
    } else {
      *step = -options_.fallback_step_size * schedule * at_x.gradient;
      report_ = "Hessian singular: gradient-descent step";
    }
    return true;
  }

  bool SaddleFreeStep(const Linearization& at_x,
                      VectorXd* step,
                      std::string* error) {
    const Index n = at_x.gradient.size();
    MatrixXd V = at_x.hessian;
    VectorXd lambda(n);
    if (LAPACKE_dsyevd(
            LAPACK_COL_MAJOR, 'V', 'L', n, V.data(), n, lambda.data()) != 0) {
      *error = "the eigenvalues of the Hessian (dsyevd) did not converge";
      return false;
    }
    const double threshold = n * std::numeric_limits<double>::epsilon() *
                             lambda.lpNorm<Eigen::Infinity>();
    VectorXd components = V.transpose() * at_x.gradient;
    int num_negative = 0;
    int num_flat = 0;
    for (Index i = 0; i < n; ++i) {
      if (std::abs(lambda[i]) <= threshold) {
        components[i] *= options_.fallback_step_size;
        ++num_flat;
      } else {
        components[i] *= *options_.step_size.step_size / std::abs(lambda[i]);
        if (lambda[i] < 0.0) ++num_negative;
      }
    }
    *step =
        -options_.step_size.ScheduleFactor(at_x.progress) * (V * components);
    report_ = fmt::format(
        "{} negative and {} flat of {} curvatures", num_negative, num_flat, n);
    return true;
  }

  const Options options_;
  std::string report_;
};

}  // namespace

std::vector<RuleRow> NewtonRuleRows() {
  Newton::Options saddle_free;
  saddle_free.saddle_free = true;
  return {
      MakeRuleRow<Newton>("newton", "step = -eta H^-1 gradient"),
      MakeRuleRow<Newton>(
          "saddle_free_newton", "step = -eta |H|^-1 gradient", saddle_free)};
}

}  // namespace invgrad
