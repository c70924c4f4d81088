// Adadelta: the gradient, scaled by the ratio of past steps to past gradients.
//
//   v <- decay v + (1 - decay) gradient^2
//   delta = sqrt(u + epsilon) / sqrt(v + epsilon) gradient
//   u <- decay u + (1 - decay) delta^2
//   step = -eta delta
//
// Shapes:  gradient, delta, u, v, step: n.
// Units:   delta has the units of x, as far as epsilon (which starts it) lets
//          it: epsilon is added to squares of both x and L / x.
// Cost:    O(n).
// Fails:   returns false if the gradient, its square or the step is not finite.
//
// As in [1] and PyTorch, with PyTorch's defaults. Keras has decay 0.95,
// epsilon 1e-7 and eta 1e-3.
//
// [1] Zeiler. ADADELTA: An Adaptive Learning Rate Method. 2012. Algorithm 1.
//     arXiv 1212.5701.
#ifndef INVGRAD_RULES_ADADELTA_H_
#define INVGRAD_RULES_ADADELTA_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class Adadelta final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{1.0};
    double decay = 0.9;     // in [0, 1)
    double epsilon = 1e-6;  // > 0

    void Describe(OptionSet* set);
  };

  explicit Adadelta(const Options& options);

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_square_, &mean_square_delta_};
  }

 private:
  const Options options_;
  Eigen::VectorXd mean_square_;        // n: v
  Eigen::VectorXd mean_square_delta_;  // n: u
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_ADADELTA_H_
