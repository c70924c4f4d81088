// The rules that need only the gradient. Products, quotients and roots are
// entry by entry; eta is the step size of step_size.h.
//
//   gradient_descent   u <- mu u + gradient                                  [1]
//                      step = -eta u
//                      nesterov: step = -eta (gradient + mu u)
//   adam               u <- beta1 u + (1 - beta1) gradient                   [2]
//                      v <- beta2 v + (1 - beta2) gradient^2
//                      step = -eta (u / (1 - beta1^k)) /
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
// Shapes:  gradient, u, v, delta, step: n.
// Units:   eta in [x]^2 / [L] for gradient_descent: the right eta depends on the
//          units of x and L. Otherwise eta in [x] and epsilon in [L]/[x], and up
//          to epsilon the step does not depend on the scale of L. adadelta: eta
//          is a number, and epsilon is added to squares of both x and L / x.
// Cost:    O(n).
// Fails:   returns false if the gradient, v or the step is not finite.
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
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

constexpr Range kDecay{0.0, 1.0, false, true};
constexpr Range kPositive{0.0, std::numeric_limits<double>::infinity(), true};

// The memory of a rule; some rules use a part of it.
struct Memory {
  VectorXd u;
  VectorXd v;
  VectorXd k = VectorXd::Zero(1);
};

// A law has the settings of a rule as its fields, and computes the step.
struct Law {
  static constexpr double kStepSize = 0.01;
  double initial_sum = 0.0;  // v at the start
};

template <typename AnyLaw>
class FirstOrderRule final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{AnyLaw::kStepSize};
    AnyLaw law;

    void Describe(OptionSet* set) {
      step_size.Describe(/*allow_auto=*/false, set);
      law.Describe(set);
    }
  };

  explicit FirstOrderRule(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Gradient();
    parts.progress = options_.step_size.has_schedule();
    return parts;
  }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    const VectorXd& gradient = at_x.gradient;
    if (!CheckFinite("the gradient", gradient, error)) return false;
    if (memory_.u.size() == 0) {
      memory_.u.setZero(gradient.size());
      memory_.v.setConstant(gradient.size(), options_.law.initial_sum);
    }
    CHECK_EQ(memory_.u.size(), gradient.size())
        << "The number of unknowns has changed; use a new update rule for each "
           "run.";
    memory_.k[0] += 1.0;
    const double eta = options_.step_size.Scheduled(at_x.progress);
    *step = options_.law.Step(gradient, eta, &memory_);
    // An infinite square would make all further steps of its entry zero.
    return CheckFinite("the squared gradient", memory_.v, error) &&
           CheckFinite("the step", *step, error);
  }

  std::vector<VectorXd*> MutableState() override {
    return {&memory_.u, &memory_.v, &memory_.k};
  }

 private:
  const Options options_;
  Memory memory_;
};

struct GradientDescent : Law {
  double momentum = 0.0;
  bool nesterov = false;

  void Describe(OptionSet* set) {
    set->Add("momentum", &momentum, kDecay, "mu, memory of the velocity");
    set->Add("nesterov", &nesterov, "look ahead along the velocity");
  }
  VectorXd Step(const VectorXd& g, double eta, Memory* memory) const {
    VectorXd& u = memory->u;
    u = momentum * u + g;
    if (nesterov) return -eta * (g + momentum * u);
    return -eta * u;
  }
};

struct Adam : Law {
  static constexpr double kStepSize = 1e-3;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;

  void Describe(OptionSet* set) {
    set->Add("beta1", &beta1, kDecay, "memory of the gradient");
    set->Add("beta2", &beta2, kDecay, "memory of the squared gradient");
    set->Add("epsilon", &epsilon, kPositive, "added to the root");
  }
  VectorXd Step(const VectorXd& g, double eta, Memory* memory) const {
    auto& [u, v, k] = *memory;
    u = beta1 * u + (1.0 - beta1) * g;
    v = beta2 * v + (1.0 - beta2) * g.cwiseAbs2();
    // Correct the bias of means that start from zero.
    const double weight_u = 1.0 - std::pow(beta1, k[0]);
    const double weight_v = 1.0 - std::pow(beta2, k[0]);
    return -eta / weight_u * u.array() /
           ((v.array() / weight_v).sqrt() + epsilon);
  }
};

struct RmsProp : Law {
  double decay = 0.99;
  double momentum = 0.0;
  double epsilon = 1e-8;

  void Describe(OptionSet* set) {
    set->Add("decay", &decay, kDecay, "memory of the squared gradient");
    set->Add("momentum", &momentum, kDecay, "mu, memory of the velocity");
    set->Add("epsilon", &epsilon, kPositive, "added to the root");
  }
  VectorXd Step(const VectorXd& g, double eta, Memory* memory) const {
    auto& [u, v, k] = *memory;
    v = decay * v + (1.0 - decay) * g.cwiseAbs2();
    u = momentum * u.array() + g.array() / (v.array().sqrt() + epsilon);
    return -eta * u;
  }
};

struct Adagrad : Law {
  double epsilon = 1e-10;

  void Describe(OptionSet* set) {
    set->Add("initial_sum",
             &initial_sum,
             {0.0, kPositive.high},
             "sum of squares at the start");
    set->Add("epsilon", &epsilon, kPositive, "added to the root");
  }
  VectorXd Step(const VectorXd& g, double eta, Memory* memory) const {
    memory->v += g.cwiseAbs2();
    return -eta * g.array() / (memory->v.array().sqrt() + epsilon);
  }
};

struct Adadelta : Law {
  static constexpr double kStepSize = 1.0;
  double decay = 0.9;
  double epsilon = 1e-6;

  void Describe(OptionSet* set) {
    set->Add("decay", &decay, kDecay, "memory of squared gradient and step");
    set->Add("epsilon", &epsilon, kPositive, "added under the roots");
  }
  VectorXd Step(const VectorXd& g, double eta, Memory* memory) const {
    auto& [u, v, k] = *memory;
    v = decay * v + (1.0 - decay) * g.cwiseAbs2();
    const VectorXd delta =
        g.array() * ((u.array() + epsilon) / (v.array() + epsilon)).sqrt();
    u = decay * u + (1.0 - decay) * delta.cwiseAbs2();
    return -eta * delta;
  }
};

}  // namespace

std::vector<RuleRow> FirstOrderRuleRows() {
  return {
      MakeRuleRow<FirstOrderRule<GradientDescent>>(
          "gradient_descent", "u <- mu u + gradient, step = -eta u"),
      MakeRuleRow<FirstOrderRule<Adam>>(
          "adam",
          "step = -eta u / (sqrt(v) + epsilon), u and v the corrected means of "
          "gradient and gradient^2"),
      MakeRuleRow<FirstOrderRule<RmsProp>>(
          "rmsprop",
          "step = -eta gradient / (sqrt(v) + epsilon), v the mean of "
          "gradient^2"),
      MakeRuleRow<FirstOrderRule<Adagrad>>(
          "adagrad",
          "step = -eta gradient / (sqrt(v) + epsilon), v the sum of "
          "gradient^2"),
      MakeRuleRow<FirstOrderRule<Adadelta>>(
          "adadelta",
          "step = -eta sqrt((u + epsilon) / (v + epsilon)) gradient, u and v "
          "the means of (step / eta)^2 and gradient^2"),
  };
}

}  // namespace invgrad
