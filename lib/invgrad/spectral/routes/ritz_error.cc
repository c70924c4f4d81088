#include "invgrad/spectral/routes/ritz_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kMachineEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Backward error of the bidiagonalization with one orthonormal basis, in units
// of s_max^2; as in step_error.cc.
constexpr double kRounding = 10.0 * kMachineEpsilon;

// The estimate is a bound up to cross terms and small constants. On synthetic
// spectra (five kinds, white, smooth and nearly invariant g, nine filters) the
// error was at most 0.9 times the estimate.
constexpr double kSafety = 5.0;

// The estimate, term by term as in the header. All values are in units of s_max,
// and phi in units of its largest value.
class ErrorEstimate {
 public:
  ErrorEstimate(const RitzValues& ritz,
                const SpectralFilter& filter,
                bool exhausted)
      : filter_(filter),
        s_max_(ritz.s[0]),
        exhausted_(exhausted),
        s_(ritz.s / s_max_),
        theta_(s_.cwiseAbs2()),
        c_(ritz.c),
        residual_(ritz.residual / s_max_),
        phi_(s_.size()) {
    for (Index j = 0; j < s_.size(); ++j) phi_[j] = filter(ritz.s[j], s_max_);
    unit_ = phi_.lpNorm<Eigen::Infinity>();
    if (unit_ > 0.0) phi_ /= unit_;
    norm_ = phi_.cwiseProduct(c_).norm();
  }

  // Relative to |d_k|.
  double Relative() const {
    if (unit_ == 0.0) return 1.0;
    // Damped and not truncated, phi has no jump and no singular slope. Clamped
    // values are not dropped.
    const double squared =
        filter_.IsDamped() && filter_.tau == 0.0
            ? Squared()
            : SquaredAcross(filter_.clamp ? 0.0 : filter_.tau);
    const double estimate =
        (kSafety * std::sqrt(squared + SquaredShift()) + RoundingError()) /
        norm_;
    // No estimate is possible if f overflows near zero.
    return estimate < kInfinity ? estimate : kInfinity;
  }

 private:
  // For f(lambda) = (lambda + mu)^-p, 0 < p <= 1. This f is a weighted mean,
  // with weights >= 0, of resolvents 1 / (lambda + t), t >= mu, and E is the
  // same mean of the errors of the resolvents. These errors are residuals of
  // the conjugate gradient method: all of one sign in t, and largest at
  // lambda = 0. The same holds for E.
  double Squared() const {
    const double mu =
        (filter_.damping / s_max_) / s_max_ + filter_.relative_damping;
    const double p = filter_.Exponent();
    // f(theta) = f(0) (1 + theta / mu)^-p, and s_0 = 1.
    const double f_zero = phi_[0] * std::pow(1.0 + 1.0 / mu, p);
    double E = 0.0;
    for (Index i = 0; i < s_.size(); ++i) {
      const double change = std::expm1(-p * std::log1p(theta_[i] / mu));
      E += residual_[i] * c_[i] * f_zero * change;
    }
    const double rounding = kRounding / mu * c_.norm();
    return E * E + rounding * rounding;
  }

  double SquaredAcross(double jump) const {
    const double lower = jump * jump;
    // The largest singular value of J may exceed the Ritz value.
    const double upper = std::pow(jump * (1.0 + std::abs(residual_[0])), 2);
    const double phi_jump = phi_.maxCoeff();
    double squared = 0.0;
    for (Index j = 0; j < s_.size(); ++j) {
      const double rho = s_[j] * std::abs(residual_[j]) + kRounding;
      if (phi_[j] == 0.0) {
        if (theta_[j] + rho < upper) continue;
        squared += std::pow(phi_jump * c_[j], 2);
        continue;
      }
      const double gap = theta_[j] - lower;
      const double leak = std::min(1.0, rho / gap);
      // The error E of a mode of J near this value, which has not converged.
      const double lambda = std::max(upper, theta_[j] - rho);
      const double E = ErrorAt(lambda > 0.0 ? lambda : 0.25 * theta_[j]);
      squared += leak * leak * (std::pow(phi_[j] * c_[j], 2) + E * E) +
                 std::pow(std::min(1.0, kRounding / gap) * phi_[j], 2);
    }
    if (phi_[s_.size() - 1] > 0.0 && !exhausted_) {
      // If no value is below the jump, some modes above the jump may be
      // missing.
      if (upper == 0.0) return kInfinity;
      squared += std::pow(ErrorAt(upper), 2);
    }
    return squared;
  }

  // The error of the largest value, on which the threshold depends.
  double SquaredShift() const {
    if (filter_.relative_damping == 0.0 && !filter_.clamp) return 0.0;
    return std::pow(2.0 * residual_[0] * norm_, 2);
  }

  // sum_i rho_i b_i f[theta_i, lambda], with rho_i = s_i r_i and b_i = s_i c_i.
  double ErrorAt(double lambda) const {
    // For smaller distances the slope is more accurate.
    constexpr double kNear = 1e-6;
    // Above a jump at lambda.
    const double root = std::sqrt(lambda) * (1.0 + 4.0 * kMachineEpsilon);
    const double f_lambda = filter_(root * s_max_, s_max_) / unit_ / root;
    double sum = 0.0;
    for (Index i = 0; i < s_.size(); ++i) {
      const double f = phi_[i] == 0.0 ? 0.0 : phi_[i] / s_[i];
      const double distance = theta_[i] - lambda;
      const double slope = std::abs(distance) < kNear * theta_[i]
                               ? f / theta_[i]
                               : (f - f_lambda) / distance;
      sum += theta_[i] * residual_[i] * c_[i] * slope;
    }
    return sum;
  }

  const SpectralFilter& filter_;
  double s_max_;
  bool exhausted_;
  VectorXd s_;
  VectorXd theta_;  // s^2
  VectorXd c_;
  VectorXd residual_;
  VectorXd phi_;
  double unit_ = 0.0;
  double norm_ = 0.0;  // |d_k|
};

}  // namespace

double RitzStepError(const RitzValues& ritz,
                     const SpectralFilter& filter,
                     bool exhausted) {
  return ErrorEstimate(ritz, filter, exhausted).Relative();
}

}  // namespace invgrad
