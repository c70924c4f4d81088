// Levenberg-Marquardt steps whose damping is found by the loss itself, with
// geodesic acceleration.
//
//   (c J^T J + lambda |J|^2) v = -J^T g            g = dL/dy, |J|: Frobenius
//   (c J^T J + lambda |J|^2) a = -1/2 J^T g_vv     g_vv = d2/dt2 g(x + t v)
//   step = v + a   if |a| < 0.75 |v| and L(x + v + a) < L(x + v),   else v
//
// One Gram matrix serves all dampings: of lambda = 1/2, 2, 8, .. times the last
// one, the step is that of the first for which L falls by at least `gain` times
// the decrease that the linear model promises for v. If none is, the step is
// zero, and lambda stays.
//
// The bend a follows the geodesic of the manifold of outputs: in the narrow,
// curved valleys of nonlinear least squares its steps are several times longer
// [1]. A gain of 0.1 asks for far less agreement with the model than a trust
// region does, and so takes longer steps [2].
//
// Shapes:  as linearization.h. H_L counts as c I, c = (g . H_L g) / |g|^2: exact
//          for squared norms.
// Cost:    the Gram matrix of the smaller side k = min(m, n), k^2 max(m, n); for
//          each lambda tried (1.5 on the average) k^3 / 3, and two or three
//          evaluations of the loss.
// Units:   lambda and gain are numbers, the step depends on the units of x as
//          that of Levenberg-Marquardt does.
// Fails:   returns false if J or g is not finite, or if the loop does not set
//          Linearization::after.
// The loss is that of the samples of the step: take all of them, or a set that
// stays for many steps. On small batches it fits their noise.
//
// [1] Transtrum, Sethna. Improvements to the Levenberg-Marquardt algorithm for
//     nonlinear least-squares minimization. 2012. arXiv 1201.5885.
// [2] The smallest gain of DSGNAR, arXiv 2607.02194, is 0.075 to 0.15.
#include <lapacke.h>

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

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstFactor = 0.5;
constexpr double kFactor = 4.0;
constexpr double kLeastDamping = 1e-30;
constexpr double kLargestDamping = 1e6;
// The length of the difference that gives g_vv, in units of v.
constexpr double kDifference = 0.1;
constexpr double kMaxBend = 0.75;

class GeodesicRule final : public UpdateRule {
 public:
  struct Options {
    double damping = 1e-3;
    double gain = 0.1;
    std::string acceleration = "on";

    void Describe(OptionSet* set) {
      set->Add("damping",
               &damping,
               {kLeastDamping, kLargestDamping},
               "lambda before the first step");
      set->Add("gain",
               &gain,
               {0.0, 1.0},
               "least decrease of the loss over that of the linear model");
      set->Add("acceleration", &acceleration, {"on", "off"}, "the bend a");
    }
  };

  explicit GeodesicRule(const Options& options)
      : options_(options), damping_(VectorXd::Constant(1, options.damping)) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.after = true;
    parts.factorization = true;
    return parts;
  }
  std::vector<VectorXd*> MutableState() override { return {&damping_}; }
  std::string LastStepReport() const override { return report_; }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    const JacobianOperator& J = *at_x.jacobian;
    const VectorXd& g = at_x.loss_gradient;
    CHECK_EQ(g.size(), J.rows());
    if (!at_x.after) {
      *error = "this loop cannot evaluate the loss at other points";
      return false;
    }
    if (!CheckFinite("the gradient of the loss in y", g, error)) return false;
    step->setZero(J.cols());
    report_ = "no step lowers the loss";
    if (g.squaredNorm() == 0.0) return true;
    c_ = CurvatureOfLoss(at_x);
    is_dual_ = J.rows() < J.cols();
    if (is_dual_) {
      J.Gram(&gram_);
    } else {
      J.ParameterGram(&gram_);
    }
    const double squared_norm = gram_.trace();
    if (!std::isfinite(squared_norm)) {
      *error = "the Jacobian is not finite";
      return false;
    }
    if (squared_norm == 0.0) return true;
    for (double damping = kFirstFactor * damping_[0];
         damping <= kLargestDamping;
         damping *= kFactor) {
      if (!Factorize(damping * squared_norm)) continue;
      if (!FindStep(at_x, step)) continue;
      damping_[0] = std::max(damping, kLeastDamping);
      return true;
    }
    step->setZero();
    return true;
  }

 private:
  static double CurvatureOfLoss(const Linearization& at_x) {
    if (!at_x.loss_hessian_times) return 1.0;
    const VectorXd& g = at_x.loss_gradient;
    const double c = g.dot(at_x.loss_hessian_times(g)) / g.squaredNorm();
    return c > 0.0 ? c : 1.0;
  }

  // c G + shift I. Returns false if it is not positive definite to working
  // precision.
  bool Factorize(double shift) {
    factor_ = c_ * gram_;
    factor_.diagonal().array() += shift;
    const auto k = static_cast<lapack_int>(factor_.rows());
    return LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', k, factor_.data(), k) == 0;
  }

  // (c J^T J + shift)^-1 J^T w.
  VectorXd Solve(const JacobianOperator& J, const VectorXd& w) const {
    VectorXd solution = w;
    if (!is_dual_) J.TransposeTimes(w, &solution);
    const auto k = static_cast<lapack_int>(factor_.rows());
    LAPACKE_dpotrs(
        LAPACK_COL_MAJOR, 'L', k, 1, factor_.data(), k, solution.data(), k);
    if (!is_dual_) return solution;
    VectorXd pulled;
    J.TransposeTimes(solution, &pulled);
    return pulled;
  }

  // The step of the factorized damping. Returns false if the loss does not fall
  // enough.
  bool FindStep(const Linearization& at_x, VectorXd* step) {
    const JacobianOperator& J = *at_x.jacobian;
    const VectorXd& g = at_x.loss_gradient;
    const VectorXd v = -Solve(J, g);
    VectorXd Jv;
    J.Times(v, &Jv);
    const double promised = -g.dot(Jv) - 0.5 * c_ * Jv.squaredNorm();
    double cost = CostAfter(at_x, v);
    *step = v;
    bool is_bent = false;
    VectorXd bend;
    if (options_.acceleration == "on" && std::isfinite(cost) &&
        FindBend(at_x, v, Jv, &bend)) {
      const double cost_of_bent = CostAfter(at_x, v + bend);
      if (cost_of_bent < cost) {
        cost = cost_of_bent;
        *step += bend;
        is_bent = true;
      }
    }
    const double gain = (at_x.cost - cost) / promised;
    if (!(cost < at_x.cost) || !(gain >= options_.gain)) return false;
    report_ =
        fmt::format("gain {:.3g}{}", gain, is_bent ? ", accelerated" : "");
    return true;
  }

  // a. Returns false if it is not known or too long.
  bool FindBend(const Linearization& at_x,
                const VectorXd& v,
                const VectorXd& Jv,
                VectorXd* bend) const {
    const VectorXd& g = at_x.loss_gradient;
    Linearization after;
    std::string ignored;
    if (!at_x.after(kDifference * v,
                    LinearizationParts::LossGradient(),
                    &after,
                    &ignored) ||
        after.loss_gradient.size() != g.size()) {
      return false;
    }
    const VectorXd g_vv =
        2.0 / kDifference * ((after.loss_gradient - g) / kDifference - c_ * Jv);
    *bend = -0.5 * Solve(*at_x.jacobian, g_vv);
    return bend->norm() < kMaxBend * v.norm();
  }

  // NaN if it has no finite value.
  static double CostAfter(const Linearization& at_x, const VectorXd& step) {
    Linearization after;
    std::string ignored;
    return at_x.after(step, LinearizationParts(), &after, &ignored)
               ? after.cost
               : std::numeric_limits<double>::quiet_NaN();
  }

  const Options options_;
  VectorXd damping_;  // lambda
  MatrixXd gram_;     // lower triangle
  MatrixXd factor_;
  double c_ = 1.0;
  bool is_dual_ = false;
  std::string report_;
};

}  // namespace

std::vector<RuleRow> GeodesicRuleRows() {
  return {MakeRuleRow<GeodesicRule>(
      "geodesic",
      "step = v + a, v = -(c J^T J + lambda |J|^2)^-1 J^T g, lambda by the "
      "loss")};
}

}  // namespace invgrad
