// Gradient descent with momentum.
//
//   v <- mu v + gradient
//   step = -eta v,   with `nesterov`: step = -eta (gradient + mu v)
//
// Shapes:  gradient, v, step: n.
// Units:   eta in [x]^2 / [L]: the right eta changes with the units of x and L,
//          and differs between entries of x with different units.
// Cost:    O(n).
// Fails:   returns false if the gradient or the step is not finite.
//
// As in PyTorch (dampening 0), where eta multiplies the velocity. Keras stores
// eta times the velocity instead, which differs while eta changes.
//
// [1] Sutskever, Martens, Dahl, Hinton. On the importance of initialization and
//     momentum in deep learning. ICML 2013.
#ifndef INVGRAD_RULES_GRADIENT_DESCENT_H_
#define INVGRAD_RULES_GRADIENT_DESCENT_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class GradientDescent final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double momentum = 0.0;  // mu in [0, 1)
    bool nesterov = false;

    void Describe(OptionSet* set);
  };

  explicit GradientDescent(const Options& options);

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override { return {&velocity_}; }

 private:
  const Options options_;
  Eigen::VectorXd velocity_;  // n: v
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_GRADIENT_DESCENT_H_
