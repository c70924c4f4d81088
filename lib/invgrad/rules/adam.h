// Adam: momentum, divided by the root mean square of past gradients.
//
//   m <- beta1 m + (1 - beta1) gradient
//   v <- beta2 v + (1 - beta2) gradient^2
//   step = -eta (m / (1 - beta1^k)) / (sqrt(v / (1 - beta2^k)) + epsilon)
//
// in the k-th step, entry by entry.
//
// Shapes:  gradient, m, v, step: n.
// Units:   eta in [x]; epsilon in [L]/[x]. Up to epsilon the step does not
//          change with the scale of L.
// Cost:    O(n).
// Fails:   returns false if the gradient, its square or the step is not finite.
//
// Algorithm 1 of [1], as in PyTorch. Keras adds epsilon before the correction
// of v (the "epsilon hat" of [1]) and has 1e-7 for it: the same as epsilon 1e-7
// / sqrt(1 - beta2^k) here.
//
// [1] Kingma, Ba. Adam: A Method for Stochastic Optimization. ICLR 2015.
//     arXiv 1412.6980.
#ifndef INVGRAD_RULES_ADAM_H_
#define INVGRAD_RULES_ADAM_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class Adam final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{1e-3};
    double beta1 = 0.9;     // in [0, 1)
    double beta2 = 0.999;   // in [0, 1)
    double epsilon = 1e-8;  // > 0

    void Describe(OptionSet* set);
  };

  explicit Adam(const Options& options);

  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_, &mean_square_, &num_steps_};
  }

 private:
  const Options options_;
  Eigen::VectorXd mean_;         // n: m
  Eigen::VectorXd mean_square_;  // n: v
  Eigen::VectorXd num_steps_ = Eigen::VectorXd::Zero(1);
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_ADAM_H_
