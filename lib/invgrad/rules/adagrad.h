// Adagrad: the gradient, divided by the root of the sum of its past squares.
//
//   v <- v + gradient^2,   v = initial_sum at the start
//   step = -eta gradient / (sqrt(v) + epsilon)
//
// Shapes:  gradient, v, step: n.
// Units:   eta in [x]; epsilon in [L]/[x]; initial_sum in [L]^2/[x]^2.
// Cost:    O(n).
// Fails:   returns false if the gradient, its square or the step is not finite.
//
// As in PyTorch, with its defaults. Keras has initial_sum 0.1, epsilon 1e-7 and
// eta 1e-3.
//
// [1] Duchi, Hazan, Singer. Adaptive Subgradient Methods for Online Learning
//     and Stochastic Optimization. JMLR 12, 2011.
#ifndef INVGRAD_RULES_ADAGRAD_H_
#define INVGRAD_RULES_ADAGRAD_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class Adagrad final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double initial_sum = 0.0;  // >= 0
    double epsilon = 1e-10;    // > 0

    void Describe(OptionSet* set);
  };

  explicit Adagrad(const Options& options);

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&sum_of_squares_};
  }

 private:
  const Options options_;
  Eigen::VectorXd sum_of_squares_;  // n: v
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_ADAGRAD_H_
