// The spectral step of a sparse J with a damped filter, by Cholesky factors of
// shifted normal equations:
//
//   d = (J^T J + lambda I)^-p J^T g,   p = (1 + kappa) / 2
//
// which is V phi(S) U^T g for phi(s) = s (s^2 + lambda)^-p. With p = 1 it takes
// one factorization, otherwise those of fractional_power.h.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "invgrad/core/finite.h"
#include "invgrad/rank/largest_singular_value.h"
#include "invgrad/spectral/routes/fractional_power.h"
#include "invgrad/spectral/routes/spectral_routes.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

// Of s_max, which Lanczos approaches from below: the filter's lambda, relative
// to s_max^2, is off by twice that.
constexpr double kNormTolerance = 1e-3;
// The spectrum of J^T J ends below this times the estimated s_max^2.
constexpr double kNormMargin = 1.1;

// *y = (J^T J + lambda I) x
void TimesNormal(const JacobianOperator& J,
                 double lambda,
                 const VectorXd& x,
                 VectorXd* product,
                 VectorXd* y) {
  J.Times(x, product);
  J.TransposeTimes(*product, y);
  *y += lambda * x;
}

}  // namespace

bool IsForCholesky(const SpectralProblem& problem) {
  return dynamic_cast<const SparseJacobian*>(&problem.J) != nullptr &&
         problem.filter.IsDamped() && problem.filter.tau == 0.0 &&
         problem.filter.Exponent() > 0.0;
}

bool CholeskyRoute(const SpectralProblem& problem,
                   double tolerance,
                   double memory_limit,
                   SpectralWorkspace* workspace,
                   VectorXd* d,
                   SpectralStepSummary* summary) {
  summary->route = SpectralRoute::kCholesky;
  if (!IsForCholesky(problem)) {
    summary->message =
        "route cholesky is for sparse Jacobians, and for filters with damping "
        "and without truncation";
    return false;
  }
  const auto& J = static_cast<const SparseJacobian&>(problem.J);
  const SpectralFilter& filter = problem.filter;
  const double s_max = LargestSingularValue(J, kNormTolerance);
  if (!std::isfinite(s_max * s_max)) {
    return CheckJacobianFinite(J, &summary->message) &&
           CheckFinite("s_max^2",
                       VectorXd::Constant(1, s_max * s_max),
                       &summary->message);
  }
  summary->s_max = s_max;
  if (s_max == 0.0) {
    *d = VectorXd::Zero(J.cols());
    return true;
  }
  const double lambda =
      filter.damping + filter.relative_damping * s_max * s_max;
  const double p = filter.Exponent();
  // What Cholesky's backward error, a few roundings of the largest eigenvalue,
  // does to the smallest.
  const double largest = kNormMargin * s_max * s_max + lambda;
  constexpr double kBackwardError =
      10.0 * std::numeric_limits<double>::epsilon();
  summary->estimated_error =
      kBackwardError * largest / lambda + (p < 1.0 ? 0.25 * tolerance : 0.0);
  // Not computed; damping keeps all that are not zero.
  summary->rank = static_cast<int>(std::min(problem.m(), problem.n()));
  if (summary->estimated_error > tolerance) {
    summary->message = "the damping is too small for normal equations";
    return false;
  }

  SparseCholesky& cholesky = workspace->cholesky;
  if (!cholesky.Analyze(J, memory_limit, &summary->message)) return false;
  VectorXd b;
  J.TransposeTimes(problem.g, &b);
  if (p == 1.0) {
    if (!cholesky.Factorize(lambda, &summary->message)) return false;
    *d = b;
    cholesky.Solve(*d);
  } else {
    const FractionalPower power =
        FractionalPower::Make(p, lambda, largest, 0.25 * tolerance);
    d->setZero(J.cols());
    VectorXd x = b;
    VectorXd product;
    VectorXd next;
    for (std::size_t k = 0; k < power.upper_terms.size(); ++k) {
      *d += power.upper_terms[k] * x;
      if (k + 1 == power.upper_terms.size()) break;
      TimesNormal(J, lambda, x, &product, &next);
      x.swap(next);
    }
    if (!cholesky.Factorize(lambda, &summary->message)) return false;
    x = b;
    for (const double term : power.lower_terms) {
      cholesky.Solve(x);
      *d += term * x;
    }
    for (const FractionalPower::Node& node : power.nodes) {
      if (!cholesky.Factorize(lambda + node.shift, &summary->message)) {
        return false;
      }
      x = b;
      cholesky.Solve(x);
      *d += node.weight * x;
    }
  }
  return CheckFinite("d", *d, &summary->message);
}

}  // namespace invgrad
