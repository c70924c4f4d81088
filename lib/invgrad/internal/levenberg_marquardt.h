// The iteration of fit.h and fit_global.h: Levenberg-Marquardt for few
// parameters, as ceres::Solve does it with its defaults, from the triangular
// factor of J alone.
//
//   minimize |R S z + c|^2 + |D z|^2 / radius,   step = S z
//   S_i = 1 / (1 + |J e_i|), at the start
//   D_i^2 = |J S e_i|^2, limited to 1e-6 ... 1e32
//   gain = (L(x) - L(x + step)) / (L(x) - 1/2 |r + J step|^2)
//   gain > 1e-3:  x += step,  radius /= max(1/3, 1 - (2 gain - 1)^3)      [1]
//   otherwise:    radius /= 2, 4, 8, ...
//
// Rows has
//
//   bool Evaluate(const Vector& x, double* cost);  // 1/2 |r|^2
//   GramRoot<N> Root();                            // at the last x
//
// Evaluate returns false where the functor does. A candidate that fails, or has
// a cost that is not finite, is rejected.
//
// Cost:    an iteration is one Evaluate, a QR decomposition of 2n x n, and one
//          Root if the step is accepted.
// Fails:   FitStatus; x is then the state of the lowest cost.
//
// [1] Madsen, Nielsen, Tingleff. Methods for Non-linear Least Squares Problems.
//     2004, equation 2.21, with Ceres' factors.
#ifndef INVGRAD_INTERNAL_LEVENBERG_MARQUARDT_H_
#define INVGRAD_INTERNAL_LEVENBERG_MARQUARDT_H_

#include <algorithm>
#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "invgrad/internal/fit_options.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/small_covariance.h"
#include "invgrad/internal/streaming_gram.h"

namespace invgrad {

// What ceres::Solver::Options has as defaults.
constexpr double kMaxTrustRegionRadius = 1e16;
constexpr double kMinTrustRegionRadius = 1e-32;
constexpr double kMinRelativeDecrease = 1e-3;
constexpr double kMinLmDiagonal = 1e-6;
constexpr double kMaxLmDiagonal = 1e32;
constexpr int kMaxConsecutiveInvalidSteps = 5;

// The trust region, and the steps within it.
template <int N>
class DampedStep {
 public:
  using Vector = typename GramRoot<N>::Vector;

  DampedStep(double radius, const GramRoot<N>& at_start) : radius_(radius) {
    S_ = (1.0 + at_start.R.colwise().norm().transpose().array()).inverse();
    Accept(at_start);
  }

  double radius() const { return radius_; }

  // False, if the step is not finite or promises no decrease.
  bool Compute(Vector* step, double* model_decrease) {
    // Rows diag(D) below R, in place of more data.
    damped_ = scaled_;
    constexpr int kPacks = (N + Pack::kLanes - 1) / Pack::kLanes;
    RowPack<N> block[kPacks] = {};
    for (int j = 0; j < N; ++j) {
      block[j / Pack::kLanes].columns[j][j % Pack::kLanes] =
          std::sqrt(D2_[j] / radius_);
    }
    AppendRows<N>(kPacks, block, &damped_);
    const Vector z =
        -damped_.R.template triangularView<Eigen::Upper>().solve(damped_.c);
    const Vector Rz = scaled_.R * z;
    *model_decrease = -Rz.dot(scaled_.c + 0.5 * Rz);
    *step = S_.cwiseProduct(z);
    return step->allFinite() && *model_decrease > 0.0;
  }

  void Accept(const GramRoot<N>& at_x) {
    scaled_ = at_x;
    scaled_.R = (at_x.R * S_.asDiagonal()).eval();
    D2_ = scaled_.R.colwise().squaredNorm().transpose();
    D2_ = D2_.cwiseMax(kMinLmDiagonal).cwiseMin(kMaxLmDiagonal);
  }
  void Grow(double gain) {
    const double change = 2.0 * gain - 1.0;
    radius_ /= std::max(1.0 / 3.0, 1.0 - change * change * change);
    radius_ = std::min(kMaxTrustRegionRadius, radius_);
    decrease_factor_ = 2.0;
  }
  void Shrink() {
    radius_ /= decrease_factor_;
    decrease_factor_ *= 2.0;
  }

 private:
  double radius_;
  double decrease_factor_ = 2.0;
  Vector S_;
  Vector D2_;
  GramRoot<N> scaled_;  // R S, c
  GramRoot<N> damped_;
};

// Rank, covariance and residual variance at the state of `root`.
template <int N>
void DescribeFit(const FitOptions& options,
                 const GramRoot<N>& root,
                 FitResult<N>* fit) {
  fit->rank = ComputeSmallCovariance<N>(
      root.R, options.rank_threshold, &fit->covariance, &fit->undetermined);
  fit->num_rows = root.num_rows;
  if (root.num_rows > fit->rank) {
    fit->residual_variance =
        2.0 * fit->cost / static_cast<double>(root.num_rows - fit->rank);
  }
}

// From fit->x; options must be valid.
template <int N, typename Rows>
void FitByLevenbergMarquardt(const FitOptions& options,
                             Rows* rows,
                             FitResult<N>* fit) {
  using Vector = typename GramRoot<N>::Vector;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vector start = fit->x;
  *fit = FitResult<N>();
  fit->x = start;
  double cost;
  if (!rows->Evaluate(fit->x, &cost) || !std::isfinite(cost)) return;
  GramRoot<N> at_x = rows->Root();
  if (!at_x.IsFinite()) return;
  fit->cost = fit->initial_cost = cost;
  DampedStep<N> damped(options.initial_trust_region_radius, at_x);
  bool is_new_state = true;  // the last step was accepted
  int num_accepted = 0;
  int num_consecutive_invalid_steps = 0;
  const auto iterate = [&]() {
    while (true) {
      if (fit->num_iterations >= options.max_num_iterations) {
        return FitStatus::kMaxIterations;
      }
      if (is_new_state) {
        // As Ceres, x - (x - g) in place of g: rounded as a change of x.
        const Vector gradient = at_x.R.transpose() * at_x.c;
        const Vector moved = fit->x - gradient;
        if ((fit->x - moved).template lpNorm<Eigen::Infinity>() <=
            options.gradient_tolerance) {
          return FitStatus::kGradientTolerance;
        }
      }
      if (damped.radius() <= kMinTrustRegionRadius) {
        return FitStatus::kMinTrustRegionRadius;
      }
      is_new_state = false;
      ++fit->num_iterations;
      Vector step;
      double model_decrease;
      if (!damped.Compute(&step, &model_decrease)) {
        if (++num_consecutive_invalid_steps >= kMaxConsecutiveInvalidSteps) {
          return FitStatus::kInvalidSteps;
        }
        damped.Shrink();
        continue;
      }
      num_consecutive_invalid_steps = 0;
      const Vector candidate = fit->x + step;
      if (!rows->Evaluate(candidate, &cost) || !std::isfinite(cost)) {
        cost = kInfinity;
      }
      const double x_norm = fit->x.norm();
      if (num_accepted > 0 && (fit->x - candidate).norm() <=
                                  options.parameter_tolerance *
                                      (x_norm + options.parameter_tolerance)) {
        return FitStatus::kParameterTolerance;
      }
      const double decrease = fit->cost - cost;
      if (std::abs(decrease) <= options.function_tolerance * fit->cost) {
        return FitStatus::kFunctionTolerance;
      }
      const double gain = decrease / model_decrease;
      if (!(gain > kMinRelativeDecrease)) {
        damped.Shrink();
        continue;
      }
      const GramRoot<N> at_candidate = rows->Root();
      if (!at_candidate.IsFinite()) return FitStatus::kInvalidJacobian;
      fit->x = candidate;
      fit->cost = cost;
      at_x = at_candidate;
      damped.Accept(at_x);
      damped.Grow(gain);
      is_new_state = true;
      ++num_accepted;
    }
  };
  fit->status = iterate();
  DescribeFit<N>(options, at_x, fit);
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_LEVENBERG_MARQUARDT_H_
