// Self-scaled Broyden: a quasi-Newton method for full batches, whose inverse
// Hessian is scaled in every update, with a line search.
//
//   step = s = -alpha H g,   alpha by the strong Wolfe conditions
//   y = g(x + s) - g(x)
//   H <- (H - H y (H y)^T / y.Hy + phi v v^T) / tau + s s^T / y.s
//   v = sqrt(y.Hy) (s / y.s - H y / y.Hy)
//
// H y = s after each update, and H stays positive definite. The parameters
// [1, equations 13 to 23; 2]:
//
//   b = -alpha g.s / y.s     h = y.Hy / y.s    a = b h - 1 >= 0
//   c = sqrt(a / (1 + a))    rho = min(1, 1 / b)
//   theta_max = max(1, b (1 + c))    theta_min = (1 / theta_max - 1) / a
//   theta = max(theta_min, min(theta_max, (1 - b) / b))
//   sigma = 1 + a theta      phi = (1 - theta) / sigma
//   tau = rho min(sigma^(-1 / (n - 1)), 1 / theta)      if theta > 0
//   tau = min(rho sigma^(-1 / (n - 1)), sigma)          else
//
// ssbfgs has theta = 0, hence phi = 1 and tau = rho; bfgs has phi = tau = 1. In
// all three, H = 1 before the first step, and the first update has
// tau = h / sigma: of bfgs, that is the usual scaling of H = 1. (In the code of
// [1] it is an option, off in its examples, in which Adam goes first.)
//
// The line search takes alpha = 1 first, in the first step min(1, 1 / |g|), and
// then brackets and interpolates by cubics [3, algorithms 3.5 and 3.6]. If it
// ends without the Wolfe conditions, the lowest point that it has found is the
// step, and H stays if y.s is not positive. If no point is lower, H = 1 again;
// if none is along -g either, the step is zero.
//
// Shapes:  x, g, s, y: n;  H: n x n, of which the lower triangle is stored.
// Cost:    two passes over n^2 / 2 numbers, and a linearization with its
//          gradient for each alpha tried, mostly one. The loop computes the
//          gradient at the accepted point once more. Memory: n^2 numbers.
// Units:   by H = 1 at the beginning, the first step and theta of the first
//          update depend on those of x and L.
// Fails:   returns false if the gradient is not finite, if n is above 20,000,
//          or if the loop does not set Linearization::after.
// The gradients at both ends of a step are those of the same samples, but H
// sums up all steps: take all samples, or a set that stays for many steps.
//
// [1] Urban, Stefanou, Pons. Unveiling the optimization process of physics
//     informed neural networks. J. Comput. Phys. 523 (2025). arXiv 2405.04230.
//     The formulas are those of its code, SSBroyden2 in
//     github.com/jorgeurban/self_scaled_algorithms_pinns.
// [2] Al-Baali, Khalfan. A wide interval for efficient self-scaling
//     quasi-Newton algorithms. Optim. Methods Softw. 20 (2005). Not opened: [1]
//     takes the formulas from it.
// [3] Nocedal, Wright. Numerical Optimization. Springer 2006, section 3.5.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/update_rule.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Eigen::Index kMaxNumUnknowns = 20000;
constexpr int kMaxNumTrials = 25;
// Least decrease of the loss over that of its tangent.
constexpr double kDecrease = 1e-4;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// A point of a line search: L, dL/dalpha and the gradient at x + alpha d. The
// loss is NaN if one of them is not finite.
struct Trial {
  double alpha = 0.0;
  double cost = kNone;
  double slope = kNone;
  VectorXd gradient;
};

// The minimizer of the cubic through two trials, at least a tenth of their
// distance away from both; half way if there is none.
double Interpolate(const Trial& low, const Trial& high) {
  const double width = high.alpha - low.alpha;
  const double secant = (high.cost - low.cost) / width;
  const double p = low.slope + high.slope - 3.0 * secant;
  const double root = std::sqrt(p * p - low.slope * high.slope);
  const double q = std::copysign(root, width);
  const double t = (q + p - low.slope) / (2.0 * q + high.slope - low.slope);
  // NaN where there is no minimizer, or no finite trial.
  const double part = std::isfinite(t) ? std::clamp(t, 0.1, 0.9) : 0.5;
  return low.alpha + part * width;
}

class SsBroydenRule final : public UpdateRule {
 public:
  struct Options {
    std::string update = "ssbroyden";
    double curvature = 0.9;

    void Describe(OptionSet* set) {
      set->Add("update",
               &update,
               {"ssbroyden", "ssbfgs", "bfgs"},
               "how phi and tau are chosen");
      set->Add("curvature",
               &curvature,
               {0.0, 1.0},
               "largest slope at the end of a step over that at its beginning");
    }
  };

  explicit SsBroydenRule(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Gradient();
    parts.after = true;
    parts.num_squares = 1;
    return parts;
  }
  std::vector<VectorXd*> MutableState() override { return {&H_}; }
  std::string LastStepReport() const override { return report_; }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    const VectorXd& g = at_x.gradient;
    const Eigen::Index n = g.size();
    if (!at_x.after) {
      *error = "this loop cannot evaluate the loss at other points";
      return false;
    }
    if (!CheckFinite("the gradient", g, error)) return false;
    if (n > kMaxNumUnknowns) {
      *error =
          fmt::format("ssbroyden keeps n^2 numbers; n is {}, allowed: up to {}",
                      n,
                      kMaxNumUnknowns);
      return false;
    }
    CHECK(H_.size() == 0 || H_.size() == n * n)
        << "The number of unknowns has changed; use a new update rule for each "
           "run.";
    step->setZero(n);
    report_ = "no step lowers the loss";
    if (g.isZero(0.0)) return true;
    Trial end;
    VectorXd d = Direction(g);
    if (!Search(at_x, d, &end)) {
      if (H_.size() == 0) return true;
      H_.resize(0);
      d = -g;
      if (!Search(at_x, d, &end)) return true;
    }
    *step = end.alpha * d;
    report_ = fmt::format("alpha {:.3g}", end.alpha);
    Update(g, *step, end);
    return true;
  }

 private:
  // -H g.
  VectorXd Direction(const VectorXd& g) const {
    if (H_.size() == 0) return -g;
    const Eigen::Map<const MatrixXd> H(H_.data(), g.size(), g.size());
    return -(H.selfadjointView<Eigen::Lower>() * g);
  }

  // Finds the end of the step along d. Returns false if no point is lower.
  bool Search(const Linearization& at_x, const VectorXd& d, Trial* end) const {
    const double slope = at_x.gradient.dot(d);
    if (!(slope < 0.0)) return false;
    Trial low = {0.0, at_x.cost, slope, at_x.gradient};
    Trial high;
    bool is_bracketed = false;
    double alpha =
        H_.size() > 0 ? 1.0 : std::min(1.0, 1.0 / at_x.gradient.norm());
    for (int i = 0; i < kMaxNumTrials; ++i) {
      Trial trial = TrialAt(at_x, d, alpha);
      const double highest = at_x.cost + kDecrease * alpha * slope;
      // Written so that NaN is too long.
      if (!(trial.cost <= highest && trial.cost < low.cost)) {
        high = std::move(trial);
        is_bracketed = true;
      } else if (std::abs(trial.slope) <= -options_.curvature * slope) {
        *end = std::move(trial);
        return true;
      } else {
        const double to_high = is_bracketed ? high.alpha - low.alpha : 1.0;
        if (trial.slope * to_high >= 0.0) {
          high = std::move(low);
          is_bracketed = true;
        }
        low = std::move(trial);
      }
      alpha = is_bracketed ? Interpolate(low, high) : 4.0 * alpha;
    }
    if (low.alpha == 0.0) return false;
    *end = std::move(low);
    return true;
  }

  static Trial TrialAt(const Linearization& at_x,
                       const VectorXd& d,
                       double alpha) {
    Trial trial;
    trial.alpha = alpha;
    Linearization after;
    std::string ignored;
    if (!at_x.after(
            alpha * d, LinearizationParts::Gradient(), &after, &ignored)) {
      return trial;
    }
    trial.slope = after.gradient.dot(d);
    if (std::isfinite(trial.slope)) trial.cost = after.cost;
    trial.gradient = std::move(after.gradient);
    return trial;
  }

  // H for the step s from a point with gradient g.
  void Update(const VectorXd& g, const VectorXd& s, const Trial& end) {
    const VectorXd y = end.gradient - g;
    const double ys = y.dot(s);
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    if (!(ys > kEpsilon * y.norm() * s.norm())) return;
    const VectorXd Hy = -Direction(y);
    const double yHy = y.dot(Hy);
    const double b = -end.alpha * g.dot(s) / ys;
    const double h = yHy / ys;
    double phi, tau;
    FindParameters(b, h, s.size(), &phi, &tau);
    report_ += fmt::format(", phi {:.3g}, tau {:.3g}", phi, tau);
    if (H_.size() == 0) {
      H_ = MatrixXd::Identity(s.size(), s.size()).reshaped();
    }
    // The update in powers of Hy and s, a column after the other.
    const double of_Hy = (phi - 1.0) / (yHy * tau);
    const double of_both = -phi / (ys * tau);
    const double of_s = (phi * h / tau + 1.0) / ys;
    Eigen::Map<MatrixXd> H(H_.data(), s.size(), s.size());
    for (Eigen::Index j = 0; j < s.size(); ++j) {
      const Eigen::Index size = s.size() - j;
      H.col(j).tail(size) = H.col(j).tail(size) / tau +
                            (of_Hy * Hy[j] + of_both * s[j]) * Hy.tail(size) +
                            (of_both * Hy[j] + of_s * s[j]) * s.tail(size);
    }
  }

  void FindParameters(
      double b, double h, Eigen::Index n, double* phi, double* tau) const {
    const double a = std::max(b * h - 1.0, 0.0);
    const double rho = std::min(1.0, 1.0 / b);
    double theta = 0.0;
    if (options_.update == "ssbroyden") {
      const double largest =
          std::max(1.0, b * (1.0 + std::sqrt(a / (1.0 + a))));
      // If a is zero, v is zero, too, and theta does not count.
      const double smallest = a > 0.0 ? (1.0 / largest - 1.0) / a : -largest;
      theta = std::max(smallest, std::min(largest, (1.0 - b) / b));
    }
    const double sigma = 1.0 + a * theta;
    *phi = (1.0 - theta) / sigma;
    if (H_.size() == 0) {
      *tau = h / sigma;
    } else if (options_.update == "bfgs") {
      *tau = 1.0;
    } else {
      const double root = n > 1 ? std::pow(sigma, -1.0 / (n - 1.0)) : 1.0;
      *tau = theta > 0.0 ? rho * std::min(root, 1.0 / theta)
                         : std::min(rho * root, sigma);
    }
  }

  const Options options_;
  VectorXd H_;  // n^2, column after column; empty: H = 1
  std::string report_;
};

}  // namespace

std::vector<RuleRow> SsBroydenRuleRows() {
  return {MakeRuleRow<SsBroydenRule>(
      "ssbroyden",
      "step = -alpha H g, H <- (H - H y (H y)^T / y.Hy + phi v v^T) / tau + "
      "s s^T / y.s, alpha by the strong Wolfe conditions")};
}

}  // namespace invgrad
