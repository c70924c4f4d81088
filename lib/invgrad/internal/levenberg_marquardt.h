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
// A tolerance ends the iteration only where the linear model agrees that there
// is a minimum (model_decrease.h). Where it does not, the iteration goes on. If
// that gains nothing after the tolerance for the cost or the step, the iteration
// ends as Ceres does.
//
// Rows has
//
//   bool Evaluate(const Vector& x, double* cost);  // 1/2 |r|^2
//   GramRoot<N> Root();                            // at the last x
//   int FirstInvalidRow(const Vector& x);          // -1: none
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
#include <optional>

#include "Eigen/Core"
#include "invgrad/internal/fit_options.h"
#include "invgrad/internal/invalid_start.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/model_decrease.h"
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

template <int N>
double PredictedDecrease(const FitOptions& options,
                         const GramRoot<N>& root,
                         const typename GramRoot<N>::Vector& x) {
  // There are no degrees of freedom.
  return root.num_rows <= N ? 0.0
                            : RelativeModelDecrease(options.function_tolerance,
                                                    options.parameter_tolerance,
                                                    root.R,
                                                    root.c,
                                                    x,
                                                    root.squared_norm());
}

// Rank, covariance and residual variance at the state of `root`.
template <int N>
void DescribeFit(const FitOptions& options,
                 const GramRoot<N>& root,
                 FitResult<N>* fit) {
  typename GramRoot<N>::Matrix R =
      root.R.template triangularView<Eigen::Upper>();
  RoundingFloor floor;
  for (int i = 0; i < N; ++i) floor.Add(R.col(i).norm(), fit->x[i]);
  for (int i = 0; i < N; ++i) {
    // A value of zero has no effect to judge by.
    if (fit->x[i] == 0.0) continue;
    if (floor.IsAbove(R.col(i).norm(), fit->x[i])) R.col(i).setZero();
  }
  fit->rank = ComputeSmallCovariance<N>(
      R, options.rank_threshold, &fit->covariance, &fit->undetermined);
  fit->num_rows = root.num_rows;
  fit->predicted_decrease = fit->status == FitStatus::kGradientTolerance &&
                                    HasVanished(fit->cost, fit->initial_cost)
                                ? 0.0
                                : PredictedDecrease<N>(options, root, fit->x);
  // Columns of too few rows may be parallel whatever the parameters are.
  const bool may_be_equal = fit->rank < N && root.num_rows >= N;
  for (int j = 1; j < N && may_be_equal; ++j) {
    for (int i = 0; i < j && fit->equal_parameter < 0; ++i) {
      constexpr double kEqual = 1e-9;
      constexpr double kParallel = 1.0 - 1e-12;
      if (!(std::abs(fit->x[i] - fit->x[j]) <= kEqual * std::abs(fit->x[i])) ||
          !(std::abs(R.col(i).dot(R.col(j))) >
            kParallel * R.col(i).norm() * R.col(j).norm())) {
        continue;
      }
      fit->equal_parameter = j;
      fit->equal_to = i;
    }
  }
  if (root.num_rows > fit->rank) {
    fit->residual_variance =
        2.0 * fit->cost / static_cast<double>(root.num_rows - fit->rank);
  }
}

// Names row and parameter of an invalid start.
template <int N, typename Rows>
void ExplainInvalidStart(Rows* rows, FitResult<N>* fit) {
  fit->invalid_row = rows->FirstInvalidRow(fit->x);
  if (fit->invalid_row < 0) return;
  const auto has_value = [&](int j, double value) {
    typename GramRoot<N>::Vector x = fit->x;
    x[j] = value;
    const int row = rows->FirstInvalidRow(x);
    return row < 0 || row > fit->invalid_row;
  };
  fit->invalid_parameter =
      FindInvalidParameter(fit->x, N, has_value, &fit->valid_value);
}

// The iteration from fit->x, where at_x is.
template <int N, typename Rows>
class LevenbergMarquardt {
 public:
  LevenbergMarquardt(const FitOptions& options,
                     const GramRoot<N>& at_start,
                     Rows* rows,
                     FitResult<N>* fit)
      : options_(options),
        rows_(*rows),
        fit_(*fit),
        at_x_(at_start),
        damped_(options.initial_trust_region_radius, at_start) {}

  const GramRoot<N>& at_x() const { return at_x_; }

  FitStatus Run() {
    while (true) {
      std::optional<FitStatus> status = Iterate();
      if (!status) continue;
      const bool is_tolerance = *status == FitStatus::kParameterTolerance ||
                                *status == FitStatus::kFunctionTolerance;
      if (!is_tolerance)
        return first_doubt_ && !HasGained() ? *first_doubt_ : *status;
      if (IsMinimum()) return *status;
      // Another iteration, with the candidate rejected or not.
      if (!first_doubt_) {
        first_doubt_ = status;
        cost_at_doubt_ = fit_.cost;
      }
      if (const std::optional<FitStatus> end = Decide()) return *end;
    }
  }

 private:
  using Vector = typename GramRoot<N>::Vector;

  // Whether the iteration has lowered the cost since the first doubt.
  bool HasGained() const {
    return fit_.cost < (1.0 - options_.function_tolerance) * cost_at_doubt_;
  }

  bool IsMinimum() const {
    return PredictedDecrease<N>(options_, at_x_, fit_.x) == 0.0;
  }

  // The end, or nothing.
  std::optional<FitStatus> Iterate() {
    if (fit_.num_iterations >= options_.max_num_iterations) {
      return FitStatus::kMaxIterations;
    }
    if (is_new_state_) {
      // As Ceres, x - (x - g) in place of g: rounded as a change of x.
      const Vector gradient = at_x_.R.transpose() * at_x_.c;
      const Vector moved = fit_.x - gradient;
      // The gradient has a unit: a small one may be that of small residuals.
      if ((fit_.x - moved).template lpNorm<Eigen::Infinity>() <=
              options_.gradient_tolerance &&
          (HasVanished(fit_.cost, fit_.initial_cost) || IsMinimum())) {
        return FitStatus::kGradientTolerance;
      }
    }
    if (damped_.radius() <= kMinTrustRegionRadius) {
      return FitStatus::kMinTrustRegionRadius;
    }
    is_new_state_ = false;
    ++fit_.num_iterations;
    Vector step;
    if (!damped_.Compute(&step, &model_decrease_)) {
      if (++num_consecutive_invalid_steps_ >= kMaxConsecutiveInvalidSteps) {
        return FitStatus::kInvalidSteps;
      }
      damped_.Shrink();
      return std::nullopt;
    }
    num_consecutive_invalid_steps_ = 0;
    candidate_ = fit_.x + step;
    if (!rows_.Evaluate(candidate_, &cost_) || !std::isfinite(cost_)) {
      cost_ = std::numeric_limits<double>::infinity();
    }
    if (num_accepted_ > 0 &&
        (fit_.x - candidate_).norm() <=
            options_.parameter_tolerance *
                (fit_.x.norm() + options_.parameter_tolerance)) {
      return FitStatus::kParameterTolerance;
    }
    if (std::abs(fit_.cost - cost_) <=
        options_.function_tolerance * fit_.cost) {
      return FitStatus::kFunctionTolerance;
    }
    return Decide();
  }

  // Accepts or rejects the candidate.
  std::optional<FitStatus> Decide() {
    const double gain = (fit_.cost - cost_) / model_decrease_;
    if (!(gain > kMinRelativeDecrease)) {
      damped_.Shrink();
      return std::nullopt;
    }
    const GramRoot<N> at_candidate = rows_.Root();
    if (!at_candidate.IsFinite()) return FitStatus::kInvalidJacobian;
    fit_.x = candidate_;
    fit_.cost = cost_;
    at_x_ = at_candidate;
    damped_.Accept(at_x_);
    damped_.Grow(gain);
    is_new_state_ = true;
    ++num_accepted_;
    return std::nullopt;
  }

  const FitOptions& options_;
  Rows& rows_;
  FitResult<N>& fit_;
  GramRoot<N> at_x_;
  DampedStep<N> damped_;
  Vector candidate_;
  double cost_ = 0.0;  // of the candidate
  double model_decrease_ = 0.0;
  bool is_new_state_ = true;  // the last step was accepted
  int num_accepted_ = 0;
  int num_consecutive_invalid_steps_ = 0;
  // A tolerance that was met where there is no minimum.
  std::optional<FitStatus> first_doubt_;
  double cost_at_doubt_ = 0.0;
};

// From fit->x; options must be valid.
template <int N, typename Rows>
void FitByLevenbergMarquardt(const FitOptions& options,
                             Rows* rows,
                             FitResult<N>* fit) {
  const typename GramRoot<N>::Vector start = fit->x;
  *fit = FitResult<N>();
  fit->x = start;
  double cost;
  GramRoot<N> at_start;
  bool is_valid = rows->Evaluate(fit->x, &cost) && std::isfinite(cost);
  if (is_valid) {
    at_start = rows->Root();
    is_valid = at_start.IsFinite();
  }
  if (!is_valid) {
    ExplainInvalidStart<N>(rows, fit);
    return;
  }
  fit->cost = fit->initial_cost = cost;
  LevenbergMarquardt<N, Rows> iteration(options, at_start, rows, fit);
  fit->status = iteration.Run();
  DescribeFit<N>(options, iteration.at_x(), fit);
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_LEVENBERG_MARQUARDT_H_
