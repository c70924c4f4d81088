// RMSprop: the gradient, divided by the root mean square of past gradients.
//
//   v <- decay v + (1 - decay) gradient^2
//   u <- mu u + gradient / (sqrt(v) + epsilon)
//   step = -eta u
//
// Shapes:  gradient, u, v, step: n.
// Units:   eta in [x]; epsilon in [L]/[x].
// Cost:    O(n).
// Fails:   returns false if the gradient, its square or the step is not finite.
//
// As in PyTorch (not centred), with its defaults. Keras has decay 0.9,
// epsilon 1e-7 and eta 1e-3, and TensorFlow's fused kernel adds epsilon under
// the root.
//
// [1] Tieleman, Hinton. Lecture 6.5: RMSprop. Coursera, 2012.
#ifndef INVGRAD_RULES_RMSPROP_H_
#define INVGRAD_RULES_RMSPROP_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class RmsProp final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double decay = 0.99;    // in [0, 1)
    double momentum = 0.0;  // mu in [0, 1)
    double epsilon = 1e-8;  // > 0

    void Describe(OptionSet* set);
  };

  explicit RmsProp(const Options& options);

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_square_, &velocity_};
  }

 private:
  const Options options_;
  Eigen::VectorXd mean_square_;  // n: v
  Eigen::VectorXd velocity_;     // n: u
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_RMSPROP_H_
