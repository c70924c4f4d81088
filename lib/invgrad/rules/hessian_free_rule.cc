// Hessian-free optimization: a damped Gauss-Newton step by truncated conjugate
// gradients, from products with J alone.
//
//   step = eta d,   d ~ argmin q(d) + lambda / 2 |d|^2
//   q(d) = g . J d + 1/2 J d . H_L J d
//
// Conjugate gradients begin at warm_start times the last d (at zero if the
// damped model is positive there), and end after i iterations if the damped
// model phi satisfies
//
//   phi_i < 0  and  (phi_i - phi_{i-k}) / phi_i < k tolerance,
//   k = max(10, i / 10)
//
// or after `iterations`, or at a direction of negative curvature, which only an
// H_L with negative values causes; if that is the first one, d is the minimizer
// along the gradient for the curvature's absolute value. The loop evaluates the
// cost after the step: with
//
//   ratio = (L(x) - L(x + step)) / (L(x) - M(step)),   M the undamped model,
//
// lambda <- lambda damping_factor if ratio < 1/4, lambda / damping_factor if
// ratio > 3/4. A step that raises the cost is reverted; [1] shortens it by a
// line search and by earlier iterates of the conjugate gradients. There is no
// preconditioner.
//
// Shapes:  g: m;  J: m x n;  H_L: m x m;  d, step: n.
// Units:   lambda in [L] / [x]^2; eta is a number.
// Cost:    an iteration: one product each with J, H_L and J^T, and 10 n. One
//          evaluation of the cost a step. Memory: 6 n. J and its Gram matrix
//          are not formed.
// Fails:   returns false if g, J^T g or the step is not finite.
//
// [1] Martens. Deep Learning via Hessian-free Optimization. ICML 2010,
//     algorithm 2 and sections 4.1, 4.4, 4.5; warm_start 0.95 from Martens,
//     Sutskever. Training Deep and Recurrent Networks with Hessian-free
//     Optimization. 2012, section 20.10.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"
#include "invgrad/update_rule.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

// Keeps lambda positive and finite.
constexpr double kLowestDamping = 1e-100;
constexpr double kHighestDamping = 1e100;

// Relative changes of the cost below this are rounding.
constexpr double kCostRounding = 1e-13;

class HessianFreeRule final : public UpdateRule, private StepJudge {
 public:
  struct Options {
    StepSizeOptions step_size{1.0};
    double damping = 1.0;
    double damping_factor = 1.5;
    int max_num_iterations = 250;
    double tolerance = 5e-4;
    double warm_start = 0.95;

    void Describe(OptionSet* set) {
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      step_size.Describe(/*allow_auto=*/false, set);
      set->Add("damping",
               &damping,
               {kLowestDamping, kHighestDamping},
               "lambda of the first step, in units of the Hessian");
      set->Add("damping_factor",
               &damping_factor,
               {1.0, 1e10},
               "lambda grows by it where the model promises too much, and "
               "falls by it where the model holds; 1: lambda stays");
      set->Add("iterations",
               &max_num_iterations,
               {1.0, 1e6},
               "of conjugate gradients, at most: products with J and with J^T");
      set->Add("tolerance",
               &tolerance,
               {0.0, kInfinity},
               "relative progress of the model in an iteration at which "
               "conjugate gradients end");
      set->Add("warm_start",
               &warm_start,
               {0.0, 1.0},
               "conjugate gradients begin at this fraction of the last step");
    }
  };

  explicit HessianFreeRule(const Options& options)
      : options_(options), damping_(VectorXd::Constant(1, options.damping)) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.progress = options_.step_size.has_schedule();
    parts.num_products = 2 * options_.max_num_iterations;
    return parts;
  }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    CHECK(at_x.jacobian != nullptr);
    report_.clear();
    if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
    VectorXd b;  // -J^T g
    at_x.jacobian->TransposeTimes(at_x.loss_gradient, &b);
    b = -b;
    if (!CheckFinite("J^T g", b, error)) return false;
    CHECK(last_.size() == 0 || last_.size() == b.size())
        << "The number of unknowns has changed; use a new update rule for each "
           "run.";
    VectorXd d;
    VectorXd residual;  // b - (G + lambda) d
    const int num_iterations = Minimize(at_x, b, &d, &residual);
    eta_ = options_.step_size.Scheduled(at_x.progress);
    *step = eta_ * d;
    if (!CheckFinite("the step", *step, error)) return false;
    cost_ = at_x.cost;
    slope_ = -b.dot(d);
    curvature_ = d.dot(b - residual) - damping_[0] * d.squaredNorm();
    last_ = d;
    report_ = fmt::format(
        "{} iterations, damping {:.2g}", num_iterations, damping_[0]);
    return true;
  }

  StepJudge* judge() override { return this; }

  bool KeepsStep(double cost, double fraction) override {
    const double eta = fraction * eta_;
    const double promised = -eta * (slope_ + 0.5 * eta * curvature_);
    const double decrease = cost_ - cost;
    const double rounding = kCostRounding * std::abs(cost_);
    // At a minimum the ratio is one of rounding errors.
    if (std::abs(decrease) <= rounding && promised <= rounding) return true;
    // Written so that NaN raises the damping.
    const bool is_good = decrease > 0.75 * promised;
    const bool is_fair = decrease >= 0.25 * promised;
    if (is_good) damping_[0] /= options_.damping_factor;
    if (!is_fair) damping_[0] *= options_.damping_factor;
    damping_[0] = std::clamp(damping_[0], kLowestDamping, kHighestDamping);
    return decrease >= 0.0;
  }

  std::vector<VectorXd*> MutableState() override { return {&damping_, &last_}; }
  std::string LastStepReport() const override { return report_; }

 private:
  // (G + lambda) v, G = J^T H_L J.
  VectorXd DampedProduct(const Linearization& at_x, const VectorXd& v) const {
    VectorXd w;
    at_x.jacobian->Times(v, &w);
    if (at_x.loss_hessian_times) w = at_x.loss_hessian_times(w);
    VectorXd product;
    at_x.jacobian->TransposeTimes(w, &product);
    return product + damping_[0] * v;
  }

  // Conjugate gradients for (G + lambda) d = b; returns the number of
  // iterations.
  int Minimize(const Linearization& at_x,
               const VectorXd& b,
               VectorXd* d,
               VectorXd* residual) const {
    VectorXd& r = *residual;
    const auto model = [&] { return -0.5 * d->dot(b + r); };
    d->setZero(b.size());
    r = b;
    if (last_.size() > 0 && options_.warm_start > 0.0) {
      *d = options_.warm_start * last_;
      r = b - DampedProduct(at_x, *d);
      if (!(model() <= 0.0)) {
        d->setZero();
        r = b;
      }
    }
    // Below this |r|^2 is rounding.
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    const double solved = kEpsilon * kEpsilon * b.squaredNorm();
    std::vector<double> models = {model()};
    VectorXd p = r;
    double rr = r.squaredNorm();
    for (int i = 1; i <= options_.max_num_iterations; ++i) {
      if (rr <= solved) return i - 1;
      const VectorXd Bp = DampedProduct(at_x, p);
      const double curvature = p.dot(Bp);
      if (curvature <= 0.0 && !d->isZero(0.0)) return i - 1;
      const double alpha = rr / std::abs(curvature);
      *d += alpha * p;
      r -= alpha * Bp;
      if (curvature <= 0.0) return i;
      models.push_back(model());
      const int k = std::max(10, i / 10);
      if (i > k && models[i] < 0.0 &&
          (models[i] - models[i - k]) / models[i] < k * options_.tolerance) {
        return i;
      }
      const double last_rr = rr;
      rr = r.squaredNorm();
      p = r + rr / last_rr * p;
    }
    return options_.max_num_iterations;
  }

  const Options options_;
  VectorXd damping_;  // lambda
  VectorXd last_;     // the last d
  std::string report_;

  // The model of the last step, for KeepsStep.
  double cost_ = 0.0;
  double slope_ = 0.0;
  double curvature_ = 0.0;
  double eta_ = 0.0;
};

}  // namespace

std::vector<RuleRow> HessianFreeRuleRows() {
  return {MakeRuleRow<HessianFreeRule>(
      "hessian_free",
      "step = eta d, (J^T H_L J + lambda) d = -J^T g by truncated conjugate "
      "gradients, lambda by the gain of the last step")};
}

}  // namespace invgrad
