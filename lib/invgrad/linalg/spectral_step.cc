#include "invgrad/linalg/spectral_step.h"

#include <cblas.h>
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "glog/logging.h"
#include "invgrad/linalg/finite.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// The entries of the backward error E of a factorization of size k are taken to
// be kBackwardError epsilon / sqrt(k), in units of the largest value. On
// synthetic spectra (six kinds, k from 1 to 128, all filters, white and smooth
// g, with nothing undecided) the error was at most 0.65 times the estimate.
constexpr double kBackwardError = 10.0;

// No route is better than a few roundings of d itself.
constexpr double kRoundings = 64.0;

// Gram matrices with a largest diagonal entry below this have lost singular
// values that are above epsilon s_max to underflow.
constexpr double kSmallestGram = 1e-270;

// A function h of the eigenvalues x_i of what was factorized: f(lambda) =
// phi(s) / s of the eigenvalues of a Gram matrix, or phi(s) of the singular
// values. Both in units of their largest value.
struct SpectralFunction {
  VectorXd x;
  VectorXd h;
  VectorXd slope;  // |h'(x)|

  // (h_i - h_j) / (x_i - x_j): what a perturbation that couples the modes i and
  // j does to h.
  double DividedDifference(Index i, Index j) const {
    // Nearer than this, the slope is the better approximation.
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

 private:
  const SpectralFilter& filter_;
  double s_max_;
  double unit_ = 0.0;
};

template <typename Function>
SpectralFunction Sample(const VectorXd& x, const Function& function) {
  // Relative step of the one-sided differences; half of the digits are plenty
  // for an estimate.
  constexpr double kStep = 1e-7;
  SpectralFunction sampled{x, VectorXd(x.size()), VectorXd::Zero(x.size())};
  for (Index i = 0; i < x.size(); ++i) {
    sampled.h[i] = function(x[i]);
    if (sampled.h[i] == 0.0) continue;
    const double step = kStep * std::max(x[i], kEpsilon);
    const double above = (function(x[i] + step) - sampled.h[i]) / step;
    // Clamping leaves a kink, with another slope below it. A jump is no slope.
    const double h_below = function(x[i] - step);
    const double below = h_below == 0.0 ? 0.0 : (sampled.h[i] - h_below) / step;
    sampled.slope[i] = std::max(std::abs(above), std::abs(below));
  }
  return sampled;
}

// Where phi jumps, in units of s_max: at tau, or at zero if phi does not vanish
// there. Negative if phi is continuous.
double JumpOf(const SpectralFilter& filter) {
  if (filter.tau > 0.0) return filter.clamp ? 0.0 : filter.tau;
  const bool vanishes =
      filter.kind == SpectralFilter::Kind::kLevenbergMarquardt
          ? filter.damping > 0.0 || filter.relative_damping > 0.0
          : filter.kappa < 0.0;
  return vanishes ? -1.0 : 0.0;
}

// Fills what the summary says about the singular values. Values of
// (s / s_max)^power within `resolution` of the jump are undecided.
void SummarizeSpectrum(const SpectralFilter& filter,
                       const VectorXd& s,
                       double s_max,
                       int power,
                       double resolution,
                       SpectralStepSummary* summary) {
  summary->s_max = s_max;
  const double jump = JumpOf(filter);
  summary->threshold_resolution =
      jump < 0.0 ? 0.0 : resolution / (power * std::pow(jump, power));
  for (const double value : s) {
    if (filter.Keeps(value, s_max)) {
      summary->s_min_kept =
          summary->rank == 0 ? value : std::min(summary->s_min_kept, value);
      ++summary->rank;
    }
    const double distance =
        std::abs(std::pow(value / s_max, power) - std::pow(jump, power));
    if (jump >= 0.0 && distance <= resolution) ++summary->num_undecided;
  }
}

// The estimate for a step of that norm. Unknown parts of the step are `unknown`
// in size; a backward error of entries one would change it by `sensitivity`.
double RelativeError(Index size,
                     double squared_sensitivity,
                     double squared_unknown,
                     double squared_norm) {
  const double entry = kBackwardError * kEpsilon / std::sqrt(size);
  const double squared_error =
      entry * entry * squared_sensitivity + squared_unknown;
  if (squared_error == 0.0) return 0.0;
  return kRoundings * kEpsilon + std::sqrt(squared_error / squared_norm);
}

// U^T g or U w.
VectorXd Times(const MatrixXd& U,
               CBLAS_TRANSPOSE transpose,
               const VectorXd& x) {
  VectorXd y(transpose == CblasNoTrans ? U.rows() : U.cols());
  cblas_dgemv(CblasColMajor,
              transpose,
              U.rows(),
              U.cols(),
              1.0,
              U.data(),
              U.rows(),
              x.data(),
              1,
              0.0,
              y.data(),
              1);
  return y;
}

bool GradientStep(const JacobianOperator& J,
                  const VectorXd& g,
                  VectorXd* d,
                  SpectralStepSummary* summary) {
  summary->route = SpectralRoute::kGradient;
  J.TransposeTimes(g, d);
  summary->estimated_error = kRoundings * kEpsilon;
  return CheckFinite("J^T g", *d, &summary->message);
}

bool SvdStep(const JacobianOperator& J,
             const VectorXd& g,
             const SpectralFilter& filter,
             VectorXd* d,
             SpectralStepSummary* summary) {
  summary->route = SpectralRoute::kSvd;
  const Index m = J.rows();
  const Index n = J.cols();
  const Index k = std::min(m, n);
  MatrixXd A;
  J.ToDense(&A);
  if (!CheckFinite("J", A, &summary->message)) return false;
  VectorXd s(k);
  MatrixXd U(m, k);
  MatrixXd Vt(k, n);
  const lapack_int info = LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                                         'S',
                                         m,
                                         n,
                                         A.data(),
                                         m,
                                         s.data(),
                                         U.data(),
                                         m,
                                         Vt.data(),
                                         k);
  if (info != 0) {
    summary->message = "the SVD of J (dgesdd) did not converge";
    return false;
  }
  const double s_max = s[0];
  if (s_max == 0.0) {
    d->setZero(n);
    return true;
  }
  const VectorXd c = Times(U, CblasTrans, g);
  VectorXd filtered(k);
  for (Index i = 0; i < k; ++i) filtered[i] = filter(s[i], s_max) * c[i];
  *d = Times(Vt, CblasTrans, filtered);

  SummarizeSpectrum(
      filter, s, s_max, 1, 2.0 * kEpsilon * std::sqrt(m + n), summary);
  s /= s_max;
  // First-order perturbation of phi, continued oddly to the eigenvalues +-s_i
  // of [0 J; J^T 0]; the columns (or rows) that J has more than rows belong to
  // eigenvalues zero.
  const ScaledFilter scaled(filter, s, s_max);
  const SpectralFunction phi = Sample(s, scaled);
  const double c_max =
      std::max(c.lpNorm<Eigen::Infinity>(), std::numeric_limits<double>::min());
  const double outside =
      m > n
          ? std::max(0.0, (g / c_max).squaredNorm() - (c / c_max).squaredNorm())
          : 0.0;
  double sensitivity = 0.0;
  double squared_norm = 0.0;
  for (Index j = 0; j < k; ++j) {
    const double c_j = c[j] / c_max;
    const double to_null_space = phi.h[j] / std::max(s[j], kEpsilon);
    double gain = n > m ? k * to_null_space * to_null_space : 0.0;
    for (Index i = 0; i < k; ++i) {
      const double odd =
          (phi.h[i] + phi.h[j]) / std::max(s[i] + s[j], kEpsilon);
      const double even = phi.DividedDifference(i, j);
      gain += 0.5 * (even * even + odd * odd);
    }
    sensitivity += gain * c_j * c_j + to_null_space * to_null_space * outside;
    squared_norm += phi.h[j] * phi.h[j] * c_j * c_j;
  }
  summary->estimated_error = RelativeError(k, sensitivity, 0.0, squared_norm);
  return CheckFinite("the step", *d, &summary->message);
}

// Both Gram routes: K = J J^T with d = J^T f(K) g, or K = J^T J with
// d = f(K) J^T g, where f(lambda) = phi(s) / s, lambda = s^2.
bool GramStep(const JacobianOperator& J,
              const VectorXd& g,
              const SpectralFilter& filter,
              SpectralRoute route,
              VectorXd* d,
              SpectralStepSummary* summary) {
  summary->route = route;
  const bool parameter_side = route == SpectralRoute::kParameterGram;
  MatrixXd K;
  if (parameter_side) {
    J.ParameterGram(&K);
  } else {
    J.Gram(&K);
  }
  const Index size = K.rows();
  // A diagonal entry is the squared norm of a row or column of J: it is not
  // finite if any entry of that is not, or if a square overflows.
  const VectorXd diagonal = K.diagonal();
  if (!CheckFinite("the diagonal of the Gram matrix of J",
                   diagonal,
                   &summary->message)) {
    return false;
  }
  const double unit = diagonal.maxCoeff();
  if (unit < kSmallestGram) {
    MatrixXd A;
    J.ToDense(&A);
    if (A.isZero(0.0)) {
      d->setZero(J.cols());
      return true;
    }
    summary->message = "the squares of J's entries underflow";
    return false;
  }
  // LAPACK's eigensolver is fed numbers of order one, whatever J's units.
  K /= unit;
  VectorXd lambda(size);
  if (LAPACKE_dsyevd(
          LAPACK_COL_MAJOR, 'V', 'L', size, K.data(), size, lambda.data()) !=
      0) {
    summary->message =
        "the eigenvalues of J's Gram matrix (dsyevd) did not "
        "converge";
    return false;
  }
  const MatrixXd& U = K;
  const double s_max = std::sqrt(lambda[size - 1]) * std::sqrt(unit);
  lambda /= lambda[size - 1];
  // Rounding leaves small eigenvalues on either side of zero.
  const VectorXd s = s_max * lambda.cwiseMax(0.0).cwiseSqrt();
  VectorXd f(size);
  for (Index i = 0; i < size; ++i) {
    const double phi = filter(s[i], s_max);
    f[i] = phi == 0.0 ? 0.0 : phi / s[i];
  }
  VectorXd b = g;
  if (parameter_side) J.TransposeTimes(g, &b);
  const VectorXd c = Times(U, CblasTrans, b);
  const VectorXd filtered = Times(U, CblasNoTrans, f.cwiseProduct(c));
  if (parameter_side) {
    *d = filtered;
  } else {
    J.TransposeTimes(filtered, d);
  }

  const double resolution =
      2.0 * kEpsilon * (size + std::sqrt(static_cast<double>(J.cols())));
  SummarizeSpectrum(filter, s, s_max, 2, resolution, summary);
  // First-order perturbation of d: the component along mode i changes by
  //   a_i sum_j f[lambda_i, lambda_j] E_ij c_j,  a_i = s_i or 1,
  // and by the roundings of the products with J before or after f(K).
  const ScaledFilter scaled(filter, s / s_max, s_max);
  const SpectralFunction scaled_f =
      Sample(lambda.cwiseMax(kEpsilon), [&scaled](double x) {
        const double root = std::sqrt(x);
        return scaled(root) / root;
      });
  const double c_max =
      std::max(c.lpNorm<Eigen::Infinity>(), std::numeric_limits<double>::min());
  const double squared_g =
      parameter_side ? (g * (s_max / c_max)).squaredNorm() : 0.0;
  double sensitivity = 0.0;
  double unknown = 0.0;
  double squared_norm = 0.0;
  for (Index i = 0; i < size; ++i) {
    const double a = parameter_side ? 1.0 : std::sqrt(scaled_f.x[i]);
    double sum = 0.0;
    for (Index j = 0; j < size; ++j) {
      const double term = scaled_f.DividedDifference(i, j) * (c[j] / c_max);
      sum += term * term;
    }
    const double h_c = scaled_f.h[i] * (c[i] / c_max);
    const double rounding =
        parameter_side ? scaled_f.h[i] * scaled_f.h[i] * squared_g : h_c * h_c;
    sensitivity += a * a * sum + rounding;
    squared_norm += a * a * h_c * h_c;
    // A value below the resolution contributes anything up to phi there; on the
    // parameter side not even its c_i is known, only |g|.
    if (lambda[i] <= resolution && scaled_f.h[i] != 0.0) {
      const double phi = scaled(std::sqrt(resolution));
      unknown +=
          phi * phi * (parameter_side ? squared_g : std::pow(c[i] / c_max, 2));
    }
  }
  summary->estimated_error =
      RelativeError(size, sensitivity, unknown, squared_norm);
  return CheckFinite("the step", *d, &summary->message);
}

}  // namespace

const char* SpectralRouteName(SpectralRoute route) {
  switch (route) {
    case SpectralRoute::kAuto:
      return "auto";
    case SpectralRoute::kSvd:
      return "svd";
    case SpectralRoute::kGram:
      return "gram";
    case SpectralRoute::kParameterGram:
      return "parameter_gram";
    case SpectralRoute::kGradient:
      return "gradient";
  }
  return "unknown";
}

bool SpectralStep(const JacobianOperator& J,
                  const VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  VectorXd* d,
                  SpectralStepSummary* summary) {
  CHECK_EQ(g.size(), J.rows());
  CHECK_GT(J.rows(), 0);
  CHECK_GT(J.cols(), 0);
  std::string invalid;
  CHECK(filter.IsValid(&invalid)) << invalid;
  *summary = SpectralStepSummary();
  if (!CheckFinite("g", g, &summary->message)) return false;

  SpectralRoute route = options.route;
  if (route == SpectralRoute::kAuto && filter.IsGradientDescent()) {
    route = SpectralRoute::kGradient;
  }
  switch (route) {
    case SpectralRoute::kSvd:
      return SvdStep(J, g, filter, d, summary);
    case SpectralRoute::kGram:
    case SpectralRoute::kParameterGram:
      return GramStep(J, g, filter, route, d, summary);
    case SpectralRoute::kGradient:
      CHECK(filter.IsGradientDescent())
          << "The gradient route only computes phi(s) = s.";
      return GradientStep(J, g, d, summary);
    case SpectralRoute::kAuto:
      break;
  }

  const SpectralRoute cheap = J.rows() <= J.cols()
                                  ? SpectralRoute::kGram
                                  : SpectralRoute::kParameterGram;
  const bool computed = GramStep(J, g, filter, cheap, d, summary);
  const bool is_decided =
      summary->num_undecided == 0 ||
      summary->threshold_resolution <= options.threshold_tolerance;
  if (computed && is_decided && summary->estimated_error <= options.tolerance) {
    return true;
  }
  std::ostringstream reason;
  reason << SpectralRouteName(cheap) << ": ";
  if (!computed) {
    reason << summary->message;
  } else if (!is_decided) {
    reason << summary->num_undecided << " values undecided";
  } else {
    reason << "estimated error " << summary->estimated_error << " > "
           << options.tolerance;
  }
  *summary = SpectralStepSummary();
  const bool success = SvdStep(J, g, filter, d, summary);
  // What stopped the SVD matters more than why it was tried.
  if (success) summary->message = reason.str();
  return success;
}

}  // namespace invgrad
