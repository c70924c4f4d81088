// The rules that need only the gradient. Products, quotients and roots are
// entry by entry; eta is the step size of step_size.h.
//
//   gradient_descent   v <- mu v + gradient                                  [1]
//                      step = -eta v
//                      nesterov: step = -eta (gradient + mu v)
//   adam               m <- beta1 m + (1 - beta1) gradient                   [2]
//                      v <- beta2 v + (1 - beta2) gradient^2
//                      step = -eta (m / (1 - beta1^k)) /
//                             (sqrt(v / (1 - beta2^k)) + epsilon)
//                      in the k-th step
//   rmsprop            v <- decay v + (1 - decay) gradient^2                 [3]
//                      u <- mu u + gradient / (sqrt(v) + epsilon)
//                      step = -eta u
//   adagrad            v <- v + gradient^2,   v = initial_sum at the start   [4]
//                      step = -eta gradient / (sqrt(v) + epsilon)
//   adadelta           v <- decay v + (1 - decay) gradient^2                 [5]
//                      delta = sqrt(u + epsilon) / sqrt(v + epsilon) gradient
//                      u <- decay u + (1 - decay) delta^2
//                      step = -eta delta
//
// All are as in PyTorch, with its defaults. Keras stores eta times the velocity
// of gradient descent, which differs while eta changes; it adds Adam's epsilon
// before the correction of v (the "epsilon hat" of [2]), so that its 1e-7 is
// 1e-7 / sqrt(1 - beta2^k) here; its other defaults are decay 0.9 (rmsprop) and
// 0.95 (adadelta), initial_sum 0.1, epsilon 1e-7 and eta 1e-3.
//
// Shapes:  gradient, m, u, v, delta, step: n.
// Units:   eta in [x]^2 / [L] for gradient_descent: the right eta depends on the
//          units of x and L. Otherwise eta in [x] and epsilon in [L]/[x], and up
//          to epsilon the step does not depend on the scale of L. adadelta: eta
//          is a number, and epsilon is added to squares of both x and L / x.
// Cost:    O(n).
// Fails:   returns false if the gradient, its square or the step is not finite.
//
// [1] Sutskever, Martens, Dahl, Hinton. On the importance of initialization and
//     momentum in deep learning. ICML 2013.
// [2] Kingma, Ba. Adam: A Method for Stochastic Optimization. ICLR 2015,
//     algorithm 1. arXiv 1412.6980.
// [3] Tieleman, Hinton. Lecture 6.5: RMSprop. Coursera, 2012. (Not centred.)
// [4] Duchi, Hazan, Singer. Adaptive Subgradient Methods for Online Learning
//     and Stochastic Optimization. JMLR 12, 2011.
// [5] Zeiler. ADADELTA: An Adaptive Learning Rate Method. 2012, algorithm 1.
//     arXiv 1212.5701.
#ifndef INVGRAD_RULES_FIRST_ORDER_RULES_H_
#define INVGRAD_RULES_FIRST_ORDER_RULES_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {

class FirstOrderRule : public UpdateRule {
 public:
  LinearizationParts Needs() const final {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) final;

 protected:
  explicit FirstOrderRule(const StepSizeOptions& step_size)
      : step_size_(step_size) {}

 private:
  // Computes the step from a finite gradient.
  virtual bool Advance(const Eigen::VectorXd& gradient,
                       double eta,
                       Eigen::VectorXd* step,
                       std::string* error) = 0;

  const StepSizeOptions step_size_;
};

class GradientDescent final : public FirstOrderRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double momentum = 0.0;  // mu in [0, 1)
    bool nesterov = false;

    void Describe(OptionSet* set);
  };

  explicit GradientDescent(const Options& options);
  std::vector<Eigen::VectorXd*> MutableState() override { return {&velocity_}; }

 private:
  bool Advance(const Eigen::VectorXd& gradient,
               double eta,
               Eigen::VectorXd* step,
               std::string* error) override;

  const Options options_;
  Eigen::VectorXd velocity_;  // v
};

class Adam final : public FirstOrderRule {
 public:
  struct Options {
    StepSizeOptions step_size{1e-3};
    double beta1 = 0.9;     // in [0, 1)
    double beta2 = 0.999;   // in [0, 1)
    double epsilon = 1e-8;  // > 0

    void Describe(OptionSet* set);
  };

  explicit Adam(const Options& options);
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_, &mean_square_, &num_steps_};
  }

 private:
  bool Advance(const Eigen::VectorXd& gradient,
               double eta,
               Eigen::VectorXd* step,
               std::string* error) override;

  const Options options_;
  Eigen::VectorXd mean_;         // m
  Eigen::VectorXd mean_square_;  // v
  Eigen::VectorXd num_steps_ = Eigen::VectorXd::Zero(1);
};

class RmsProp final : public FirstOrderRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double decay = 0.99;    // in [0, 1)
    double momentum = 0.0;  // mu in [0, 1)
    double epsilon = 1e-8;  // > 0

    void Describe(OptionSet* set);
  };

  explicit RmsProp(const Options& options);
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_square_, &velocity_};
  }

 private:
  bool Advance(const Eigen::VectorXd& gradient,
               double eta,
               Eigen::VectorXd* step,
               std::string* error) override;

  const Options options_;
  Eigen::VectorXd mean_square_;  // v
  Eigen::VectorXd velocity_;     // u
};

class Adagrad final : public FirstOrderRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.01};
    double initial_sum = 0.0;  // >= 0
    double epsilon = 1e-10;    // > 0

    void Describe(OptionSet* set);
  };

  explicit Adagrad(const Options& options);
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&sum_of_squares_};
  }

 private:
  bool Advance(const Eigen::VectorXd& gradient,
               double eta,
               Eigen::VectorXd* step,
               std::string* error) override;

  const Options options_;
  Eigen::VectorXd sum_of_squares_;  // v
};

class Adadelta final : public FirstOrderRule {
 public:
  struct Options {
    StepSizeOptions step_size{1.0};
    double decay = 0.9;     // in [0, 1)
    double epsilon = 1e-6;  // > 0

    void Describe(OptionSet* set);
  };

  explicit Adadelta(const Options& options);
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&mean_square_, &mean_square_delta_};
  }

 private:
  bool Advance(const Eigen::VectorXd& gradient,
               double eta,
               Eigen::VectorXd* step,
               std::string* error) override;

  const Options options_;
  Eigen::VectorXd mean_square_;        // v
  Eigen::VectorXd mean_square_delta_;  // u
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_FIRST_ORDER_RULES_H_
