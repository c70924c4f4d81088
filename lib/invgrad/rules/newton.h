// Newton's method with the exact Hessian, and its saddle-free form.
//
//   step = -eta H^-1 gradient                              H = d2L/dx2
//   step = -eta |H|^-1 gradient,   |H| = V |Lambda| V^T    (saddle-free)
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
#ifndef INVGRAD_RULES_NEWTON_H_
#define INVGRAD_RULES_NEWTON_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class Newton final : public UpdateRule {
 public:
  struct Options {
    bool saddle_free = false;  // selects the rule; not a setting
    StepSizeOptions step_size{1.0};
    double fallback_step_size = 0.01;  // of gradient descent

    void Describe(OptionSet* set);
  };

  explicit Newton(const Options& options);

  LinearizationParts Needs() const override;
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::string LastStepReport() const override { return report_; }

 private:
  bool NewtonStep(const Linearization& at_x,
                  Eigen::VectorXd* step,
                  std::string* error);
  bool SaddleFreeStep(const Linearization& at_x,
                      Eigen::VectorXd* step,
                      std::string* error);

  const Options options_;
  std::string report_;
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_NEWTON_H_
