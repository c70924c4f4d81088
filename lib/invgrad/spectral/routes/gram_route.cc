// Computes the step from the smaller of the two Gram matrices.
//
//   K = J J^T or J^T J = unit Q T Q^T,   f(K) b = Q f(unit T) Q^T b
//
// where unit is a power of two, so that the entries of T are of order one for
// any units of J. d = J^T f(J J^T) g, or f(J^T J) J^T g.
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/routes/tridiagonal_function.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// If the largest diagonal entry of the Gram matrix is below this, singular
// values above epsilon s_max underflow.
constexpr double kSmallestGram = 1e-270;

// Below this size computing all eigenvectors is as cheap as a contour integral,
// and gives a better error estimate. Measured: equal at 48.
constexpr Index kSmallestReduced = 64;

// J^T J in place of J J^T.
bool IsParameterSide(const SpectralProblem& problem) {
  return problem.n() < problem.m();
}

// Values of (s / s_max)^2 within this distance of the jump are undecided.
double Resolution(const SpectralProblem& problem) {
  const auto size = static_cast<double>(std::min(problem.m(), problem.n()));
  const auto other_size =
      static_cast<double>(std::max(problem.m(), problem.n()));
  return 2.0 * kEpsilon * (size + std::sqrt(other_size));
}

enum class GramResult { kFailed, kZero, kDone };

// Fills buffers->gram with K / unit (its lower triangle) and ->unit. kZero: J,
// or J^T g, is zero. kFailed sets summary->message: J is not finite, or its
// squares over- or underflow.
GramResult FormGram(const SpectralProblem& problem,
                    SpectralBuffers* buffers,
                    SpectralStepSummary* summary) {
  MatrixXd& K = buffers->gram;
  if (IsParameterSide(problem)) {
    problem.J.ParameterGram(&K);
  } else {
    problem.J.Gram(&K);
  }
  // A diagonal entry is the squared norm of a row or column of J. It is not
  // finite if an entry of this row or column is not finite, or if a square
  // overflows.
  const auto diagonal = K.diagonal();
  if (!diagonal.allFinite()) {
    if (CheckJacobianFinite(problem.J, &summary->message)) {
      summary->message = "the squares of J's entries overflow";
    }
    return GramResult::kFailed;
  }
  const double largest = diagonal.maxCoeff();
  if (largest < kSmallestGram) {
    // J = 0, or for this g as good as that.
    problem.J.TransposeTimes(problem.g, &buffers->product);
    if (buffers->product.isZero(0.0)) return GramResult::kZero;
    summary->message = "the squares of J's entries underflow";
    return GramResult::kFailed;
  }
  // Entries of ordinary size need no scaling, which saves a pass.
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (std::abs(exponent) <= 100) exponent = 0;
  buffers->unit = std::ldexp(1.0, exponent);
  if (exponent != 0) K.triangularView<Eigen::Lower>() *= 1.0 / buffers->unit;
  return GramResult::kDone;
}

// *d from w = f(K) b.
bool MakeStep(const SpectralProblem& problem,
              const VectorXd& w,
              VectorXd* d,
              SpectralStepSummary* summary) {
  if (IsParameterSide(problem)) {
    *d = w;
  } else {
    problem.J.TransposeTimes(w, d);
  }
  return CheckFinite("the step", *d, &summary->message);
}

// Computes f(K) b from all eigenvectors of K.
bool EigenvectorStep(const SpectralProblem& problem,
                     SpectralBuffers* buffers,
                     VectorXd* d,
                     SpectralStepSummary* summary) {
  MatrixXd& U = buffers->gram;
  const int size = static_cast<int>(U.rows());
  VectorXd& lambda = buffers->values;
  lambda.resize(size);
  if (LAPACKE_dsyevd(
          LAPACK_COL_MAJOR, 'V', 'L', size, U.data(), size, lambda.data()) !=
      0) {
    summary->message =
        "the eigenvalues of J's Gram matrix (dsyevd) did not converge";
    return false;
  }
  const double s_max = std::sqrt(lambda[size - 1]) * std::sqrt(buffers->unit);
  lambda /= lambda[size - 1];
  // Rounding may make small eigenvalues negative.
  const VectorXd s = s_max * lambda.cwiseMax(0.0).cwiseSqrt();
  VectorXd& c = buffers->y;
  c.resize(size);
  Gemv(Op::kTranspose, 1.0, U, buffers->b, 0.0, c);
  VectorXd filtered(size);
  for (Index i = 0; i < size; ++i) {
    const double phi = problem.filter(s[i], s_max);
    filtered[i] = phi == 0.0 ? 0.0 : phi / s[i] * c[i];
  }
  VectorXd& w = buffers->product;
  w.resize(size);
  Gemv(Op::kNone, 1.0, U, filtered, 0.0, w);
  const double resolution = Resolution(problem);
  SummarizeSpectrum(problem.filter, s, s_max, 2, resolution, summary);
  summary->estimated_error =
      IsParameterSide(problem)
          ? ParameterGramStepError(
                problem.filter, lambda, s_max, c, problem.g.norm(), resolution)
          : GramStepError(problem.filter, lambda, s_max, c, resolution);
  return MakeStep(problem, w, d, summary);
}

// Computes f(K) b from the tridiagonal form of K.
bool ReducedStep(const SpectralProblem& problem,
                 SpectralBuffers* buffers,
                 VectorXd* d,
                 SpectralStepSummary* summary) {
  buffers->reduction.Compute(&buffers->gram);
  buffers->tridiagonal.Set(buffers->reduction.diagonal(),
                           buffers->reduction.off_diagonal());
  buffers->reduction.ApplyQTranspose(&buffers->b);
  const bool parameter_side = IsParameterSide(problem);
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
    d->setZero(problem.n());
    return true;
  }
  const double relative_error =
      ApplyCutFunction(f, lambda_max, cut, parameter_side, buffers);
  const double norm_y = StepNorm(parameter_side, buffers->y, buffers);
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
  buffers->y *= f.Scale();
  return MakeStep(problem, buffers->y, d, summary);
}

}  // namespace

bool GramRoute(const SpectralProblem& problem,
               SpectralBuffers* buffers,
               VectorXd* d,
               SpectralStepSummary* summary) {
  switch (FormGram(problem, buffers, summary)) {
    case GramResult::kFailed:
      return false;
    case GramResult::kZero:
      d->setZero(problem.n());
      return true;
    case GramResult::kDone:
      break;
  }
  if (IsParameterSide(problem)) {
    problem.J.TransposeTimes(problem.g, &buffers->b);
  } else {
    buffers->b = problem.g;
  }
  return buffers->gram.rows() < kSmallestReduced || problem.filter.clamp
             ? EigenvectorStep(problem, buffers, d, summary)
             : ReducedStep(problem, buffers, d, summary);
}

}  // namespace invgrad
