// Options and result of a least-squares fit with few parameters, for fit.h
// and fit_global.h.
//
//   FitResult<2> fit;
//   fit.x << 1.0, 0.0;                                // the start
//   FitStreaming(options, num_rows, functor, &fit);   // fit.h
//   if (!fit.IsConverged()) std::cerr << fit.StatusText();
//   std::cout << fit.x[0] << " +- " << fit.StandardError(0) << "\n";
//
// FitMany and FitStreaming (fit.h) minimize the cost 1/2 |r(x)|^2 by the
// same iteration: the trust region of ceres::Solve with its names and defaults.
// The number of parameters N is known at compile time, as that of Jets.
#ifndef INVGRAD_INTERNAL_FIT_OPTIONS_H_
#define INVGRAD_INTERNAL_FIT_OPTIONS_H_

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "Eigen/Core"
#include "invgrad/internal/small_covariance.h"

namespace invgrad {

// The options up to initial_trust_region_radius are those of
// ceres::Solver::Options.
struct FitOptions {
  int max_num_iterations = 50;
  // |change of the cost| <= function_tolerance cost
  double function_tolerance = 1e-6;
  // max_i |dL/dx_i| <= gradient_tolerance
  double gradient_tolerance = 1e-10;
  // |step| <= parameter_tolerance (|x| + parameter_tolerance)
  double parameter_tolerance = 1e-8;
  double initial_trust_region_radius = 1e4;
  // Directions with s <= rank_threshold s_max are undetermined
  // (small_covariance.h). In [1e-12, 1).
  double rank_threshold = 1e-7;
  int num_threads = 1;

  bool IsValid(std::string* error) const;
};

enum class FitStatus {
  // Converged, with the inequality of this tolerance, if x is a minimum.
  kGradientTolerance,
  kParameterTolerance,
  kFunctionTolerance,
  kMinTrustRegionRadius,
  // Not converged; x is the best state.
  kMaxIterations,
  kInvalidSteps,     // no step decreases the linearized cost
  kInvalidJacobian,  // not finite at a state of lower cost
  // Failed at the start, where x stays: the functor returns false, or its
  // values or derivatives are not finite.
  kInvalidStart,
};

// "converged: the gradient is below its tolerance", ...
std::string FitStatusText(FitStatus status);

// FitStatusText and what else is notable; members as of FitResult.
//   "failed: ...: row 3, parameter 1 = -0.31 (valid at 0.31)"
//   "not converged: ...; no minimum: the linear model predicts that the cost
//   falls by 3.5 %"
//   "converged: ...; parameters 1 and 3 coincide at 0.5, where J loses rank:
//   start from different values"
struct FitRemarks {
  FitStatus status = FitStatus::kInvalidStart;
  int invalid_row = -1;
  int invalid_parameter = -1;
  double value = 0.0;
  double valid_value = 0.0;
  double predicted_decrease = 0.0;
  int equal_parameter = -1;
  int equal_to = -1;

  std::string ToText() const;
};

template <int N>
struct FitResult {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  // In: the start. Out: the state of the lowest cost.
  Vector x = Vector::Zero();

  FitStatus status = FitStatus::kInvalidStart;
  double initial_cost = kNaN;  // 1/2 |r|^2; NaN: kInvalidStart
  double cost = kNaN;
  // Of kInvalidStart: the first row without a finite value or derivative, and the
  // parameter of which another value, valid_value, mends it; -1: no single one.
  int invalid_row = -1;
  int invalid_parameter = -1;
  double valid_value = kNaN;
  int num_iterations = 0;  // steps tried
  int64_t num_rows = 0;    // m

  // At x; not a number, and rank 0, if the start is invalid.
  // The pseudo-inverse (J^T J)^+, as of ceres::Covariance: the covariance of x
  // if each residual has the variance 1.
  Matrix covariance = Matrix::Constant(kNaN);
  // The share of x_i in the directions that the data leave open, in [0, 1]
  // (small_covariance.h): above zero if they leave x_i open. Its variance is then
  // infinite, whatever the pseudo-inverse has.
  Vector undetermined = Vector::Constant(kNaN);
  int rank = 0;
  // The relative decrease of the cost that the linear model predicts at x; 0 at
  // a minimum, or below ten times the function tolerance (model_decrease.h).
  double predicted_decrease = kNaN;
  // Two parameters of equal value with columns of J that are parallel, such as
  // equal rates of two decays: J has lost rank there, and no step parts them.
  // -1: none.
  int equal_parameter = -1;
  int equal_to = -1;
  // |r|^2 / (m - rank); NaN if m <= rank.
  double residual_variance = kNaN;

  bool IsConverged() const {
    return status <= FitStatus::kMinTrustRegionRadius &&
           !(predicted_decrease > 0.0);
  }

  // FitStatusText, and what else is notable: row and parameter of an invalid
  // start, an end that is no minimum, parameters that coincide.
  std::string StatusText() const {
    FitRemarks remarks;
    remarks.status = status;
    remarks.invalid_row = invalid_row;
    remarks.invalid_parameter = invalid_parameter;
    if (invalid_parameter >= 0) remarks.value = x[invalid_parameter];
    remarks.valid_value = valid_value;
    remarks.predicted_decrease = predicted_decrease;
    remarks.equal_parameter = equal_parameter;
    remarks.equal_to = equal_to;
    if (equal_parameter >= 0) remarks.value = x[equal_parameter];
    return remarks.ToText();
  }

  // sqrt(residual_variance covariance_ii); infinite if x_i is undetermined.
  double StandardError(int i) const {
    if (undetermined[i] > kLeastUndeterminedShare) {
      return std::numeric_limits<double>::infinity();
    }
    return std::sqrt(residual_variance * covariance(i, i));
  }
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_FIT_OPTIONS_H_
