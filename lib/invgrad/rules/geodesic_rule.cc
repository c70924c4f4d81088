// Levenberg-Marquardt steps whose damping is found by the loss itself, with
// geodesic acceleration.
//
//   (c J^T J + lambda D) v = -J^T g            g = dL/dy
//   (c J^T J + lambda D) a = -1/2 J^T g_vv     g_vv = d2/dt2 g(x + t v)
//   step = v + a, or v        |step| <= max_relative_step |x| if m < 2 n
//
// D, and how long a may be, depend on whether J is dense or sparse
// (damped_normal_equations.h). The step is that of the first lambda for which L
// falls by at least `gain` times the decrease that the linear model promises for
// v, and that is not too long. If there is none, the step is zero, and lambda
// stays. On small batches the limit on the length matters: with hardly more rows
// m than weights n, or fewer, small lambda make steps that fit the batch, blow the
// weights up and saturate the neurons. With more rows a long step is one that the
// data determine, and a limit would only slow it down.
//
//   geodesic   no limit: for all samples in each step, and for ceres::Solve
//   adaptive   a tenth of |x|, and in training a raced batch size
//              (batch_race.h), with which a run reports the best weights that it
//              has evaluated: for batches, with nothing to set
//
//   dense J    v + a if L is lower there than at v. Of lambda = 1/2, 2, 8, ..
//              times the last one.
//   sparse J   v + a if L falls enough there, so that L at v is not needed. Of
//              lambda = f, 4 f, 16 f, .. times the last one, f = 1/100 if the
//              last gain was above 3/4, 1/2 above 1/4, else 1; at first 1/10.
//
// The bend a follows the geodesic of the manifold of outputs: in the narrow,
// curved valleys of nonlinear least squares its steps are several times longer
// [1]. A gain of 0.1 needs far less agreement with the model than a trust region
// does, and so takes longer steps [2]. On large sparse problems the bend alone
// gains little, but with it lambda may fall faster. With the robust losses of a
// ceres::Problem, g at x + t v has the weights of x (problem_linearizer.h).
//
// Shapes:  as linearization.h. H_L counts as c I, c = (g . H_L g) / |g|^2: exact
//          for squared norms.
// Cost:    one factorization for each lambda tried (1.5 on the average), two
//          solutions with it, and two or three evaluations of the loss.
// Units:   lambda and gain are numbers. The steps do not depend on the units of
//          the loss and of y; on those of x with a dense J only.
// Fails:   returns false if J or g is not finite, if memory does not suffice, or
//          if the loop does not set Linearization::after.
// The loss is that of the samples of the step: on a small batch of noisy data a
// step fits their noise.
//
// [1] Transtrum, Sethna. Improvements to the Levenberg-Marquardt algorithm for
//     nonlinear least-squares minimization. 2012. arXiv 1201.5885.
// [2] The smallest gain of DSGNAR, arXiv 2607.02194, is 0.075 to 0.15.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/damped_normal_equations.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

constexpr double kFactor = 4.0;
constexpr double kLeastDamping = 1e-30;
constexpr double kLeastSparseDamping = 1e-15;
constexpr double kLargestDamping = 1e6;
// With so many rows for each column the length of a step has no limit.
constexpr double kDetermined = 2.0;
// The length of the difference that gives g_vv, in units of v.
constexpr double kDifference = 0.1;

class GeodesicRule final : public UpdateRule {
 public:
  struct Options {
    double damping = 1e-3;
    double gain = 0.1;
    std::string acceleration = "on";
    double max_relative_step = 0.0;

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
      set->Add(
          "max_relative_step",
          &max_relative_step,
          {0.0, 1e9},
          "longest step, over |x|, of a J with fewer than two rows for each "
          "column; 0: no limit");
    }
  };

  explicit GeodesicRule(const Options& options)
      : options_(options), damping_(VectorXd::Constant(1, options.damping)) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.after = true;
    parts.factorization = true;
    parts.by_cholesky = true;
    parts.uses_sparsity = true;
    return parts;
  }
  std::vector<VectorXd*> MutableState() override { return {&damping_, &gain_}; }
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
    const bool is_sparse = dynamic_cast<const SparseJacobian*>(&J) != nullptr;
    if (equations_ == nullptr || is_sparse != is_sparse_) {
      is_sparse_ = is_sparse;
      equations_ =
          is_sparse ? MakeSparseNormalEquations() : MakeDenseNormalEquations();
    }
    if (!equations_->SetJacobian(J, c_, error)) return false;
    if (equations_->Norm() == 0.0) return true;
    for (double damping = FirstDamping(); damping <= kLargestDamping;
         damping *= kFactor) {
      if (!equations_->Factorize(damping)) continue;
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

  double FirstDamping() const {
    if (!is_sparse_) return 0.5 * damping_[0];
    const double gain = gain_[0];
    const double factor = gain == 0.0   ? 0.1
                          : gain > 0.75 ? 0.01
                          : gain > 0.25 ? 0.5
                                        : 1.0;
    return std::max(factor * damping_[0], kLeastSparseDamping);
  }

  // The step of the factorized damping. Returns false if the loss does not fall
  // enough.
  bool FindStep(const Linearization& at_x, VectorXd* step) {
    const VectorXd& g = at_x.loss_gradient;
    const VectorXd v = -equations_->Solve(g);
    if (IsTooLong(at_x, v)) return false;
    VectorXd Jv;
    at_x.jacobian->Times(v, &Jv);
    const double promised = -g.dot(Jv) - 0.5 * c_ * Jv.squaredNorm();
    const auto falls_enough = [&](double cost) {
      return cost < at_x.cost && (at_x.cost - cost) / promised >= options_.gain;
    };
    const double highest = std::numeric_limits<double>::infinity();
    double cost = is_sparse_ ? highest : CostAfter(at_x, v);
    double bent_cost = highest;
    VectorXd bend;
    // A dense v with no finite loss is no start for a bend.
    if (options_.acceleration == "on" && !std::isnan(cost) &&
        FindBend(at_x, v, Jv, &bend) && !IsTooLong(at_x, v + bend)) {
      bent_cost = CostAfter(at_x, v + bend);
    }
    const bool is_bent =
        bent_cost < cost && (!is_sparse_ || falls_enough(bent_cost));
    if (is_bent) {
      cost = bent_cost;
    } else if (is_sparse_) {
      cost = CostAfter(at_x, v);
    }
    if (!falls_enough(cost)) return false;
    *step = is_bent ? VectorXd(v + bend) : v;
    gain_[0] = (at_x.cost - cost) / promised;
    report_ =
        fmt::format("gain {:.3g}{}", gain_[0], is_bent ? ", accelerated" : "");
    return true;
  }

  bool IsTooLong(const Linearization& at_x, const VectorXd& step) const {
    const JacobianOperator& J = *at_x.jacobian;
    if (J.rows() >= kDetermined * J.cols()) return false;
    const double longest = options_.max_relative_step * at_x.norm_of_x;
    return longest > 0.0 && step.norm() > longest;
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
    *bend = -0.5 * equations_->Solve(g_vv);
    return equations_->LimitBend(v, bend);
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
  // Of the last step; 0: there was none.
  VectorXd gain_ = VectorXd::Zero(1);
  std::unique_ptr<DampedNormalEquations> equations_;
  bool is_sparse_ = false;
  double c_ = 1.0;
  std::string report_;
};

}  // namespace

std::vector<RuleRow> GeodesicRuleRows() {
  const GeodesicRule::Options geodesic;
  GeodesicRule::Options adaptive;
  adaptive.max_relative_step = 0.1;
  std::vector<RuleRow> rows = {
      MakeRuleRow<GeodesicRule>("geodesic",
                                "step = v + a, v = -(c J^T J + lambda D)^-1 "
                                "J^T g, lambda by the loss",
                                geodesic),
      MakeRuleRow<GeodesicRule>("adaptive",
                                "the step of geodesic, |step| <= |x| / 10 if "
                                "J has fewer than two rows a column; the batch "
                                "size is raced in training",
                                adaptive)};
  rows.back().races_batch_size = true;
  return rows;
}

}  // namespace invgrad
