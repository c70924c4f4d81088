// Computes the step from the smaller of the two Gram matrices.
//
//   K = J J^T or J^T J = unit Q T Q^T,   f(K) b = Q f(unit T) Q^T b
//
// where unit is a power of two, so that the entries of T are of order one for
// any units of J. d = J^T f(J J^T) g, or f(J^T J) J^T g.
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <optional>

#include "invgrad/core/finite.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/internal/blas.h"
#include "invgrad/spectral/routes/gram_matrix.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/routes/spectrum_cut.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Below this size computing all eigenvectors is as cheap as a contour integral,
// and gives a better error estimate. Measured: equal at 48.
constexpr Index kSmallestReduced = 64;

// From this size on, the ranks that share J share its Gram matrix. (A test makes
// shared steps of this size.)
constexpr Index kSmallestShared = 1000;

// Values of (s / s_max)^2 within this distance of the jump are undecided.
double Resolution(const SpectralProblem& problem) {
  return GramResolution(problem.m(), problem.n());
}

// *d from w = f(K) b.
bool MakeStep(const SpectralProblem& problem, const VectorXd& w) {
  if (problem.parameter_side()) {
    *problem.d = w;
  } else {
    problem.J.TransposeTimes(w, problem.d);
  }
  return CheckFinite("the step", *problem.d, &problem.summary->message);
}

// Computes f(K) b from all eigenvectors of K.
bool EigenvectorStep(const SpectralProblem& problem) {
  SpectralBuffers* buffers = problem.buffers;
  MatrixXd& U = buffers->gram;
  const int size = static_cast<int>(U.rows());
  VectorXd& lambda = buffers->values;
  lambda.resize(size);
  if (LAPACKE_dsyevd(
          LAPACK_COL_MAJOR, 'V', 'L', size, U.data(), size, lambda.data()) !=
      0) {
    problem.summary->message =
        "the eigenvalues of J's Gram matrix (dsyevd) did not converge";
    return false;
  }
  const double s_max = std::sqrt(lambda[size - 1]) * std::sqrt(buffers->unit);
  VectorXd& c = buffers->y;
  c.resize(size);
  Gemv(Op::kTranspose, 1.0, U, buffers->b, 0.0, c);
  lambda /= lambda[size - 1];
  // Rounding may make small eigenvalues negative.
  const VectorXd s = s_max * lambda.cwiseMax(0.0).cwiseSqrt();
  VectorXd filtered(size);
  for (Index i = 0; i < size; ++i) {
    const double phi = problem.filter(s[i], s_max);
    filtered[i] = phi == 0.0 ? 0.0 : phi / s[i] * c[i];
  }
  VectorXd& w = buffers->product;
  w.resize(size);
  Gemv(Op::kNone, 1.0, U, filtered, 0.0, w);
  const double resolution = Resolution(problem);
  SummarizeSpectrum(problem, s, s_max, 2, resolution);
  std::optional<double> norm_g;
  if (problem.parameter_side()) norm_g = problem.g.norm();
  problem.summary->estimated_error =
      GramStepError(problem.filter, lambda, s_max, c, norm_g, resolution);
  return MakeStep(problem, w);
}

// Tolerance of the quadrature, relative to the largest |f|.
constexpr double kContourTolerance = 1e-15;

// The root mean square over four random perturbations is hardly ever less than
// a third of the root mean square over all perturbations. One perturbation is
// not enough: if a single number determines the error (one value is kept, or
// one small value lies far from the others), this number may happen to be
// small.
constexpr double kSampleSafety = 3.0;

// Entries +-1 of a fixed pseudo-random sequence (splitmix64).
void FillSigns(Eigen::Index size, Tridiagonal::Perturbations* signs) {
  if (signs->cols() == size) return;
  signs->resize(Eigen::NoChange, size);
  std::uint64_t state = 0;
  for (double& sign : signs->reshaped()) {
    state += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    sign = ((z ^ (z >> 31)) & 1u) != 0 ? 1.0 : -1.0;
  }
}

// f(lambda) = phi(s) / s, lambda = s^2, in units of T: lambda / unit ->
// f(lambda) / scale = (lambda / unit + damping)^-exponent.
struct GramFunction {
  // lambda_max in units of T.
  GramFunction(const SpectralFilter& filter, double unit, double lambda_max)
      : exponent(filter.Exponent()),
        damping(filter.damping / unit + filter.relative_damping * lambda_max),
        scale(std::pow(unit, -filter.Exponent())) {}

  std::complex<double> operator()(std::complex<double> z) const {
    return exponent == 1.0 ? 1.0 / (z + damping)
                           : std::pow(z + damping, -exponent);
  }

  // f has a pole or a branch point here, and is analytic above.
  double singularity() const { return -damping; }
  // 1 / (z + damping), defined at roundings below zero too.
  bool is_damped_resolvent() const { return exponent == 1.0 && damping > 0.0; }

  double exponent;
  double damping;
  double scale;
};

// The norm of the step by f(T) h = y.
double StepNorm(const SpectralProblem& problem, const VectorXd& y) {
  if (problem.parameter_side()) return y.norm();
  VectorXd& Ty = problem.buffers->product;
  problem.buffers->tridiagonal.Times(y, &Ty);
  return std::sqrt(std::abs(y.dot(Ty)));
}

// buffers->y = f(T) h for the eigenvalues that `cut` keeps, 0 for the others; h
// is buffers->b. A contour integral takes 70 to 130 solutions with T,
// Levenberg-Marquardt without a cut a single one. Returns the relative error of
// the step due to the backward error of the reduction.
double ApplyCutFunction(const SpectralProblem& problem,
                        const GramFunction& f,
                        double lambda_max,
                        const Cut& cut) {
  SpectralBuffers* buffers = problem.buffers;
  Tridiagonal& T = buffers->tridiagonal;
  buffers->shifts.clear();
  buffers->coefficients.clear();
  if (f.is_damped_resolvent() && cut.num_below == 0) {
    // (T + damping)^-1 h = Im[-i (z - T)^-1 h] with z = -damping.
    buffers->shifts.emplace_back(f.singularity());
    buffers->coefficients.emplace_back(0.0, -1.0);
  } else {
    // Rounding may move eigenvalues slightly out of the interval.
    const double gap = std::max(cut.above - cut.below, RoundingOf(T));
    const double below = cut.below + 0.1 * gap;
    const double above = std::max(cut.above - 0.1 * gap, below + 0.1 * gap);
    ContourQuadrature(cut.num_below == 0 ? cut.below : below,
                      above,
                      lambda_max * (1.0 + 1e-3) + gap,
                      kContourTolerance,
                      &buffers->nodes);
    for (const ContourNode& node : buffers->nodes) {
      buffers->shifts.push_back(node.z);
      buffers->coefficients.push_back(node.weight * f(node.z));
    }
  }
  FillSigns(T.size(), &buffers->perturbations);
  T.ApplyResolvents(buffers->shifts,
                    buffers->coefficients,
                    buffers->b,
                    &buffers->y,
                    &buffers->perturbations,
                    &buffers->changes);
  double squared_change = 0.0;
  for (int p = 0; p < Tridiagonal::kNumPerturbations; ++p) {
    buffers->change = buffers->changes.col(p);
    const double norm = StepNorm(problem, buffers->change);
    squared_change += norm * norm / Tridiagonal::kNumPerturbations;
  }
  if (squared_change == 0.0) return 0.0;
  return kSampleSafety * BackwardError(T.size()) * lambda_max *
         std::sqrt(squared_change) / StepNorm(problem, buffers->y);
}

// Computes f(K) b from the tridiagonal form of K.
bool ReducedStep(const SpectralProblem& problem) {
  SpectralBuffers* buffers = problem.buffers;
  SpectralStepSummary* summary = problem.summary;
  if (buffers->strips.communicator() != nullptr) {
    buffers->reduction.ComputeStrips(buffers->strips, &buffers->gram);
  } else {
    buffers->reduction.Compute(&buffers->gram);
  }
  buffers->tridiagonal.Set(buffers->reduction.diagonal(),
                           buffers->reduction.off_diagonal());
  buffers->reduction.ApplyQTranspose(&buffers->b);
  const bool parameter_side = problem.parameter_side();
  const double root_unit = std::sqrt(buffers->unit);
  const Tridiagonal& T = buffers->tridiagonal;
  const double lambda_max = T.Eigenvalue(T.size() - 1);
  const double jump = JumpOf(problem.filter);
  const double wanted = std::max(jump, 0.0) * std::max(jump, 0.0) * lambda_max;
  const double resolution = Resolution(problem);
  const GramFunction f(problem.filter, buffers->unit, lambda_max);
  Cut cut = FindCut(T, wanted, resolution * lambda_max, f.singularity());
  // If f is defined for slightly negative arguments, no eigenvalue is cut off:
  // negative eigenvalues are at most as large as the backward error.
  const double lowest = -2.0 * std::sqrt(static_cast<double>(T.size())) *
                        BackwardError(T.size()) * lambda_max;
  const bool is_resolved = f.singularity() < lowest;
  if (jump < 0.0 && is_resolved) {
    cut.num_below = 0;
    cut.below = f.singularity();
    cut.above = T.Eigenvalue(0);
  }
  summary->s_max = std::sqrt(lambda_max) * root_unit;
  summary->rank = T.size() - cut.num_below;
  if (summary->rank > 0) {
    summary->s_min_kept = std::sqrt(std::max(cut.above, 0.0)) * root_unit;
  }
  if (jump >= 0.0) {
    summary->num_undecided = cut.num_undecided;
    summary->threshold_resolution = resolution / (2.0 * jump * jump);
  }
  const double norm_b = buffers->b.norm();
  if (norm_b == 0.0 || summary->rank == 0) {
    problem.d->setZero(problem.n());
    return true;
  }
  const double relative_error = ApplyCutFunction(problem, f, lambda_max, cut);
  const double norm_y = StepNorm(problem, buffers->y);
  // On the parameter side, b = J^T g has additional rounding errors.
  const double norm_g = problem.g.norm() * root_unit;
  double rounding = RoundingError();
  if (parameter_side) {
    rounding += kEpsilon * std::sqrt(lambda_max) * norm_g *
                std::abs(f(cut.above)) / norm_y;
  }
  // Values below the resolution may contribute up to the maximum of phi there.
  if (jump < 0.0 && !is_resolved) {
    const double smallest = resolution * lambda_max;
    int num_unknown = 0;
    T.CountBelow(&smallest, 1, &num_unknown);
    const double peak = problem.filter.PeakBelow(
                            std::sqrt(smallest) * root_unit, summary->s_max) /
                        root_unit;
    rounding += std::sqrt(1.0 * num_unknown / T.size()) * peak *
                std::abs(f(peak * peak)) * (parameter_side ? norm_g : norm_b) /
                norm_y;
  }
  summary->estimated_error = relative_error + rounding;
  buffers->reduction.ApplyQ(&buffers->y);
  buffers->y *= f.scale;
  return MakeStep(problem, buffers->y);
}

}  // namespace

bool GramRoute(const SpectralProblem& problem) {
  SpectralBuffers* buffers = problem.buffers;
  std::string* message = &problem.summary->message;
  MatrixXd& K = buffers->gram;
  const Index size = std::min(problem.m(), problem.n());
  // Each rank has the whole of a matrix that is not worth sharing.
  const bool is_shared = !problem.filter.clamp && size >= kSmallestShared;
  buffers->strips =
      ColumnStrips(size, is_shared ? RanksOf(problem.J) : nullptr);
  if (problem.parameter_side()) {
    problem.J.TransposeTimes(problem.g, &buffers->b);
  } else {
    buffers->b = problem.g;
  }
  if (!SmallerGram(problem.J,
                   buffers->strips,
                   &K,
                   &buffers->values,
                   &buffers->unit,
                   message)) {
    return false;
  }
  if (buffers->unit == 0.0) {
    // J = 0, or for this g as good as that.
    problem.J.TransposeTimes(problem.g, problem.d);
    if (problem.d->isZero(0.0)) return true;
    *message = "the squares of J's entries underflow";
    return false;
  }
  return K.rows() < kSmallestReduced || problem.filter.clamp
             ? EigenvectorStep(problem)
             : ReducedStep(problem);
}

}  // namespace invgrad
