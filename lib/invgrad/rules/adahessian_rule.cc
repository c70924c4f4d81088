// AdaHessian: Adam with Hutchinson's estimate of the Hessian's diagonal in place
// of the gradient in the second moment.
//
//   D = z * (H z),   H = d2L/dx2,   z of random signs
//   u <- beta1 u + (1 - beta1) gradient
//   v <- beta2 v + (1 - beta2) D^2
//   step = -eta (u / (1 - beta1^k)) /
//          (sqrt(v / (1 - beta2^k))^hessian_power + epsilon)
//
// in the k-th step; products, quotients and powers are entry by entry. z_i is -1
// where np.random.rand(n) after np.random.seed(seed + k) is below 1/2. The mean
// of D over z is the diagonal of H, and D is the diagonal for every z if H is
// diagonal. Defaults are those of [1] and its code, without the average of D
// over the entries of a convolution kernel.
//
// Shapes:  gradient, z, D, u, v, step: n.
// Units:   with hessian_power 1, eta is a number, and up to epsilon ([L]/[x]^2)
//          the step does not depend on the units of x and L. H z by differences
//          does, where x is far below one (hessian_times.h).
// Cost:    one product with H (two gradients, hessian_times.h); O(n).
// Fails:   returns false if the gradient, H z, v or the step is not finite, or
//          if the linearization has no products with H.
//
// [1] Yao, Gholami, Shen, Mustafa, Keutzer, Mahoney. ADAHESSIAN: An Adaptive
//     Second Order Optimizer for Machine Learning. AAAI 2021, algorithms 1 and
//     2. arXiv 2006.00719.
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/random.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

class AdaHessianRule final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{0.15};
    double beta1 = 0.9;
    double beta2 = 0.999;
    double epsilon = 1e-4;
    double hessian_power = 1.0;
    int seed = 0;

    void Describe(OptionSet* set) {
      constexpr Range kMemory{0.0, 1.0, false, true};
      step_size.Describe(/*allow_auto=*/false, set);
      set->Add("beta1", &beta1, kMemory, "memory of the gradient");
      set->Add("beta2", &beta2, kMemory, "memory of the squared diagonal");
      set->Add("epsilon",
               &epsilon,
               {0.0, std::numeric_limits<double>::infinity(), true},
               "added to the root");
      set->Add("hessian_power",
               &hessian_power,
               {0.0, 1.0},
               "exponent of the root: 0 momentum alone, 1 the whole diagonal");
      set->Add("seed",
               &seed,
               {0.0, std::numeric_limits<int>::max()},
               "of the random signs");
    }
  };

  explicit AdaHessianRule(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Gradient();
    parts.hessian_times = true;
    parts.progress = options_.step_size.has_schedule();
    return parts;
  }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    const VectorXd& gradient = at_x.gradient;
    if (!CheckFinite("the gradient", gradient, error)) return false;
    if (!at_x.hessian_times) {
      *error = "adahessian needs products with the Hessian";
      return false;
    }
    if (u_.size() == 0) {
      u_.setZero(gradient.size());
      v_.setZero(gradient.size());
    }
    CHECK_EQ(u_.size(), gradient.size())
        << "The number of unknowns has changed; use a new update rule for each "
           "run.";
    k_[0] += 1.0;
    const VectorXd z = Signs();
    VectorXd Hz;
    if (!at_x.hessian_times(z, &Hz, error)) return false;
    const double beta1 = options_.beta1;
    const double beta2 = options_.beta2;
    u_ = beta1 * u_ + (1.0 - beta1) * gradient;
    // D^2 = (H z)^2, because the entries of z^2 are one.
    v_ = beta2 * v_ + (1.0 - beta2) * Hz.cwiseAbs2();
    // Correct the bias of means that start from zero.
    const double weight_u = 1.0 - std::pow(beta1, k_[0]);
    const double weight_v = 1.0 - std::pow(beta2, k_[0]);
    const double eta = options_.step_size.Scheduled(at_x.progress);
    *step = -eta / weight_u * u_.array() /
            ((v_.array() / weight_v).sqrt().pow(options_.hessian_power) +
             options_.epsilon);
    return CheckFinite("the squared diagonal", v_, error) &&
           CheckFinite("the step", *step, error);
  }

  std::vector<VectorXd*> MutableState() override { return {&u_, &v_, &k_}; }

 private:
  // Of the k-th step, so that a resumed run needs only k.
  VectorXd Signs() const {
    NumpyRandom random(static_cast<std::uint32_t>(options_.seed) +
                       static_cast<std::uint32_t>(k_[0]));
    VectorXd z(u_.size());
    for (double& sign : z) sign = random.Rand() < 0.5 ? -1.0 : 1.0;
    return z;
  }

  const Options options_;
  VectorXd u_;
  VectorXd v_;
  VectorXd k_ = VectorXd::Zero(1);
};

}  // namespace

std::vector<RuleRow> AdaHessianRuleRows() {
  return {MakeRuleRow<AdaHessianRule>(
      "adahessian",
      "step = -eta u / (sqrt(v)^hessian_power + epsilon), u and v the "
      "corrected means of gradient and (z (H z))^2, z random signs")};
}

}  // namespace invgrad
