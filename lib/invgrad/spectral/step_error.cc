#include "invgrad/spectral/step_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// A function h of the eigenvalues or singular values x_i:
// f(lambda) = phi(s) / s for a Gram matrix, phi(s) for an SVD. h and x are in
// units of their largest value.
struct SpectralFunction {
  VectorXd x;
  VectorXd h;
  VectorXd slope;  // |h'(x)|

  // (h_i - h_j) / (x_i - x_j): the change of h by a perturbation that couples
  // the modes i and j.
  double DividedDifference(Index i, Index j) const {
    // For smaller distances the slope is more accurate.
    constexpr double kNear = 1e-5;
    if (h[i] == h[j]) return x[i] == x[j] ? slope[i] : 0.0;
    const double distance = std::abs(x[i] - x[j]);
    const bool jumps = h[i] == 0.0 || h[j] == 0.0;
    if (!jumps && distance < kNear * std::max(x[i], x[j])) return slope[i];
    return (h[i] - h[j]) / std::max(distance, kEpsilon);
  }
};

// phi, in units of its largest value on the spectrum, as a function of
// s / s_max.
class ScaledFilter {
 public:
  // `s` in units of s_max.
  ScaledFilter(const SpectralFilter& filter, const VectorXd& s, double s_max)
      : filter_(filter), s_max_(s_max) {
    for (const double value : s) {
      unit_ = std::max(unit_, std::abs(filter(value * s_max, s_max)));
    }
    if (unit_ == 0.0) unit_ = 1.0;
  }
  double operator()(double s) const {
    return filter_(s * s_max_, s_max_) / unit_;
  }
  double PeakBelow(double highest) const {
    return (*this)(filter_.PeakBelow(highest * s_max_, s_max_) / s_max_);
  }

 private:
  const SpectralFilter& filter_;
  double s_max_;
  double unit_ = 0.0;
};

template <typename Function>
SpectralFunction Sample(const VectorXd& x, const Function& function) {
  // Relative step of the one-sided differences; half of the digits suffice for
  // an estimate.
  constexpr double kStep = 1e-7;
  SpectralFunction sampled{x, VectorXd(x.size()), VectorXd::Zero(x.size())};
  for (Index i = 0; i < x.size(); ++i) {
    sampled.h[i] = function(x[i]);
    if (sampled.h[i] == 0.0) continue;
    const double step = kStep * std::max(x[i], kEpsilon);
    const double above = (function(x[i] + step) - sampled.h[i]) / step;
    // A clamped phi has a kink, with another slope below. A jump has no slope.
    const double h_below = function(x[i] - step);
    const double below = h_below == 0.0 ? 0.0 : (sampled.h[i] - h_below) / step;
    sampled.slope[i] = std::max(std::abs(above), std::abs(below));
  }
  return sampled;
}

double LargestMagnitude(const VectorXd& c) {
  return std::max(c.lpNorm<Eigen::Infinity>(),
                  std::numeric_limits<double>::min());
}

// The relative error of a step with this norm. Undetermined parts of the step
// have the norm `unknown`; a backward error with unit entries changes the step
// by `sensitivity`.
double RelativeError(Index size,
                     double squared_sensitivity,
                     double squared_unknown,
                     double squared_norm) {
  const double entry = BackwardError(size);
  const double squared_error =
      entry * entry * squared_sensitivity + squared_unknown;
  if (squared_error == 0.0) return 0.0;
  return RoundingError() + std::sqrt(squared_error / squared_norm);
}

}  // namespace

double BackwardError(Index size) {
  return 10.0 * kEpsilon / std::sqrt(static_cast<double>(size));
}

double RoundingError() { return 128.0 * kEpsilon; }

double SvdStepError(const SpectralFilter& filter,
                    const VectorXd& s,
                    double s_max,
                    const VectorXd& c,
                    double outside,
                    bool wide) {
  const Index k = s.size();
  // First-order perturbation of phi, continued oddly to the eigenvalues +-s_i
  // of [0 J; J^T 0]; the surplus columns (or rows) of J have eigenvalues zero.
  const ScaledFilter scaled(filter, s / s_max, s_max);
  const SpectralFunction phi = Sample(s / s_max, scaled);
  const double c_max = LargestMagnitude(c);
  const double squared_outside = std::pow(outside / c_max, 2);
  double sensitivity = 0.0;
  double squared_norm = 0.0;
  for (Index j = 0; j < k; ++j) {
    const double c_j = c[j] / c_max;
    const double to_null_space = phi.h[j] / std::max(phi.x[j], kEpsilon);
    double gain = wide ? k * to_null_space * to_null_space : 0.0;
    for (Index i = 0; i < k; ++i) {
      const double odd =
          (phi.h[i] + phi.h[j]) / std::max(phi.x[i] + phi.x[j], kEpsilon);
      const double even = phi.DividedDifference(i, j);
      gain += 0.5 * (even * even + odd * odd);
    }
    sensitivity +=
        gain * c_j * c_j + to_null_space * to_null_space * squared_outside;
    squared_norm += phi.h[j] * phi.h[j] * c_j * c_j;
  }
  return RelativeError(k, sensitivity, 0.0, squared_norm);
}

double GramStepError(const SpectralFilter& filter,
                     const VectorXd& lambda,
                     double s_max,
                     const VectorXd& c,
                     std::optional<double> norm_g,
                     double resolution) {
  const bool parameter_side = norm_g.has_value();
  const VectorXd s = lambda.cwiseMax(0.0).cwiseSqrt();
  const ScaledFilter scaled(filter, s, s_max);
  const SpectralFunction f =
      Sample(lambda.cwiseMax(kEpsilon), [&scaled](double x) {
        const double root = std::sqrt(x);
        return scaled(root) / root;
      });
  const double c_max = LargestMagnitude(c);
  const double squared_g = std::pow(norm_g.value_or(0.0) * s_max / c_max, 2);
  double sensitivity = 0.0;
  double unknown = 0.0;
  double squared_norm = 0.0;
  for (Index i = 0; i < lambda.size(); ++i) {
    const double a = parameter_side ? 1.0 : std::sqrt(f.x[i]);
    double sum = 0.0;
    for (Index j = 0; j < lambda.size(); ++j) {
      const double term = f.DividedDifference(i, j) * (c[j] / c_max);
      sum += term * term;
    }
    // Adds the rounding errors of the products with J before or after f(K).
    const double h_c = f.h[i] * (c[i] / c_max);
    const double rounding =
        parameter_side ? f.h[i] * f.h[i] * squared_g : h_c * h_c;
    sensitivity += a * a * sum + rounding;
    squared_norm += a * a * h_c * h_c;
    // A value below the resolution may contribute up to the maximum of phi
    // there; on the parameter side its c_i is unknown and bounded by |g|.
    if (lambda[i] <= resolution && f.h[i] != 0.0) {
      const double phi = scaled.PeakBelow(std::sqrt(resolution));
      unknown +=
          phi * phi * (parameter_side ? squared_g : std::pow(c[i] / c_max, 2));
    }
  }
  return RelativeError(lambda.size(), sensitivity, unknown, squared_norm);
}

}  // namespace invgrad
