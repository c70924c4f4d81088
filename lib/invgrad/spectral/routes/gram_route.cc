#include "invgrad/spectral/routes/gram_route.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>

#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Gram matrices with a largest diagonal entry below this have lost singular
// values that are above epsilon s_max to underflow.
constexpr double kSmallestGram = 1e-270;

// Below this size all eigenvectors are as cheap as a contour integral, and say
// more about the error. Measured: ties at 48.
constexpr Index kSmallestReduced = 64;

// Of the quadrature, relative to the largest |f|.
constexpr double kContourTolerance = 1e-15;

// The mean error of four random perturbations is hardly ever less than a third
// of the mean over all of them (root mean squares). One is not enough: where a
// single number decides the error (one value kept, or one small one far from
// the others), that of one sample is small whenever this number happens to be.
constexpr double kSampleSafety = 3.0;

// Entries +-1 of a fixed pseudo-random sequence (splitmix64).
void FillSigns(Index size, Tridiagonal::Perturbations* signs) {
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

// f(z) = phi(sqrt(z)) / sqrt(z) in T's units, up to the factor that
// GramStepScale gives.
class GramFunction {
 public:
  GramFunction(const SpectralFilter& filter, double unit, double lambda_max)
      : exponent_(filter.Exponent()),
        damping_(filter.damping / unit + filter.relative_damping * lambda_max) {
  }
  Complex operator()(Complex z) const {
    return exponent_ == 1.0 ? 1.0 / (z + damping_)
                            : std::pow(z + damping_, -exponent_);
  }
  // It has a pole or a branch point here, and is analytic above.
  double singularity() const { return -damping_; }
  // 1 / (z + damping), defined at roundings below zero too.
  bool is_damped_resolvent() const {
    return exponent_ == 1.0 && damping_ > 0.0;
  }

 private:
  double exponent_;
  double damping_;
};

// Of the step that y is to give: |sqrt(T) y|, or |y| on the parameter side.
double StepNorm(bool parameter_side,
                const VectorXd& y,
                SpectralWorkspace* workspace) {
  if (parameter_side) return y.norm();
  workspace->tridiagonal.Times(y, &workspace->product);
  return std::sqrt(std::abs(y.dot(workspace->product)));
}

// All eigenvectors of K, by LAPACK's dsyevd.
bool EigenvectorStep(const SpectralProblem& problem,
                     SpectralRoute route,
                     SpectralWorkspace* workspace,
                     VectorXd* d,
                     SpectralStepSummary* summary) {
  const bool parameter_side = route == SpectralRoute::kParameterGram;
  const double unit = workspace->unit;
  MatrixXd& K = workspace->gram;
  const int size = static_cast<int>(K.rows());
  VectorXd& lambda = workspace->values;
  lambda.resize(size);
  double query = 0.0;
  int int_query = 0;
  LAPACKE_dsyevd_work(LAPACK_COL_MAJOR,
                      'V',
                      'L',
                      size,
                      K.data(),
                      size,
                      lambda.data(),
                      &query,
                      -1,
                      &int_query,
                      -1);
  workspace->lapack_numbers.resize(
      std::max(workspace->lapack_numbers.size(), static_cast<size_t>(query)));
  workspace->lapack_integers.resize(std::max(workspace->lapack_integers.size(),
                                             static_cast<size_t>(int_query)));
  if (LAPACKE_dsyevd_work(
          LAPACK_COL_MAJOR,
          'V',
          'L',
          size,
          K.data(),
          size,
          lambda.data(),
          workspace->lapack_numbers.data(),
          static_cast<int>(workspace->lapack_numbers.size()),
          workspace->lapack_integers.data(),
          static_cast<int>(workspace->lapack_integers.size())) != 0) {
    summary->message =
        "the eigenvalues of J's Gram matrix (dsyevd) did not converge";
    return false;
  }
  const MatrixXd& U = K;
  const double s_max = std::sqrt(lambda[size - 1]) * std::sqrt(unit);
  lambda /= lambda[size - 1];
  // Rounding leaves small eigenvalues on either side of zero.
  const VectorXd s = s_max * lambda.cwiseMax(0.0).cwiseSqrt();
  VectorXd& c = workspace->y;
  c.resize(size);
  Gemv(Op::kTranspose, 1.0, U, workspace->b, 0.0, c);
  VectorXd filtered(size);
  for (Index i = 0; i < size; ++i) {
    const double phi = problem.filter(s[i], s_max);
    filtered[i] = phi == 0.0 ? 0.0 : phi / s[i] * c[i];
  }
  VectorXd& w = workspace->product;
  w.resize(size);
  Gemv(Op::kNone, 1.0, U, filtered, 0.0, w);
  if (parameter_side) {
    *d = w;
  } else {
    problem.J.TransposeTimes(w, d);
  }
  const double resolution =
      GramResolution(size, parameter_side ? problem.m() : problem.n());
  SummarizeSpectrum(problem.filter, s, s_max, 2, resolution, summary);
  summary->estimated_error =
      parameter_side
          ? ParameterGramStepError(
                problem.filter, lambda, s_max, c, problem.g.norm(), resolution)
          : GramStepError(problem.filter, lambda, s_max, c, resolution);
  return CheckFinite("the step", *d, &summary->message);
}

// By the tridiagonal form of K.
bool ReducedStep(const SpectralProblem& problem,
                 SpectralRoute route,
                 SpectralWorkspace* workspace,
                 VectorXd* d,
                 SpectralStepSummary* summary) {
  const bool parameter_side = route == SpectralRoute::kParameterGram;
  const double unit = workspace->unit;
  const Tridiagonal& T = workspace->tridiagonal;
  const SpectralFilter& filter = problem.filter;
  const double lambda_max = T.Eigenvalue(T.size() - 1);
  const double jump = JumpOf(filter);
  const double wanted = std::max(jump, 0.0) * std::max(jump, 0.0) * lambda_max;
  const double resolution =
      GramResolution(T.size(), parameter_side ? problem.m() : problem.n());
  const GramFunction f(filter, unit, lambda_max);
  Cut cut = FindCut(T, wanted, resolution * lambda_max, f.singularity());
  // Nothing is cut off where f is defined at roundings below zero: they are as
  // large as the norm of the backward error.
  const double lowest = -2.0 * std::sqrt(static_cast<double>(T.size())) *
                        BackwardError(T.size()) * lambda_max;
  const bool is_resolved = f.singularity() < lowest;
  if (jump < 0.0 && is_resolved) {
    cut.num_below = 0;
    cut.below = f.singularity();
    cut.above = T.Eigenvalue(0);
  }
  summary->s_max = std::sqrt(lambda_max) * std::sqrt(unit);
  summary->rank = T.size() - cut.num_below;
  if (summary->rank > 0) {
    summary->s_min_kept = std::sqrt(std::max(cut.above, 0.0)) * std::sqrt(unit);
  }
  if (jump >= 0.0) {
    summary->num_undecided = cut.num_undecided;
    summary->threshold_resolution = resolution / (2.0 * jump * jump);
  }
  const double norm_b = workspace->b.norm();
  if (norm_b == 0.0 || summary->rank == 0) {
    d->setZero(problem.n());
    return true;
  }
  const double relative_error =
      ApplyCutFunction(filter, lambda_max, cut, parameter_side, workspace);
  const double norm_y = StepNorm(parameter_side, workspace->y, workspace);
  // On the parameter side b = J^T g has roundings of its own.
  const double norm_g = problem.g.norm() * std::sqrt(unit);
  double rounding = RoundingError();
  if (parameter_side) {
    rounding += kEpsilon * std::sqrt(lambda_max) * norm_g *
                std::abs(f(cut.above)) / norm_y;
  }
  // Values below the resolution contribute anything up to phi's peak there.
  if (jump < 0.0 && !is_resolved) {
    const double smallest = resolution * lambda_max;
    int num_unknown = 0;
    T.CountBelow(&smallest, 1, &num_unknown);
    const double root_unit = std::sqrt(unit);
    const double peak =
        filter.PeakBelow(std::sqrt(smallest) * root_unit, summary->s_max) /
        root_unit;
    rounding += std::sqrt(1.0 * num_unknown / T.size()) * peak *
                std::abs(f(peak * peak)) * (parameter_side ? norm_g : norm_b) /
                norm_y;
  }
  summary->estimated_error = relative_error + rounding;
  workspace->reduction.ApplyQ(&workspace->y);
  workspace->y *= GramStepScale(filter, unit);
  if (parameter_side) {
    *d = workspace->y;
  } else {
    problem.J.TransposeTimes(workspace->y, d);
  }
  return CheckFinite("the step", *d, &summary->message);
}

}  // namespace

Cut FindCut(const Tridiagonal& T,
            double wanted,
            double resolution,
            double singularity) {
  Cut cut;
  const double rounding =
      4.0 * kEpsilon * std::max(T.upper_bound(), -T.lower_bound());
  // How many are within the resolution, and if some are: the widest gap there.
  constexpr int kProbes = 63;
  double probes[kProbes];
  int counts[kProbes];
  for (int k = 0; k < kProbes; ++k) {
    probes[k] = wanted + resolution * (2.0 * k / (kProbes - 1) - 1.0);
  }
  T.CountBelow(probes, kProbes, counts);
  cut.num_undecided = counts[kProbes - 1] - counts[0];
  cut.threshold = wanted;
  cut.num_below = counts[kProbes / 2];
  if (cut.num_undecided > 0) {
    int widest = 0;
    for (int first = 0; first < kProbes;) {
      int end = first + 1;
      while (end < kProbes && counts[end] == counts[first]) ++end;
      if (end - first > widest) {
        widest = end - first;
        cut.threshold = probes[first + widest / 2];
        cut.num_below = counts[first];
      }
      first = end;
    }
  }
  // The eigenvalues on either side. Those that are known to be far from
  // everything else need not be sharp: the quadrature only wants a gap.
  if (cut.num_below < T.size()) {
    cut.above =
        T.Eigenvalue(cut.num_below, cut.threshold, T.upper_bound(), rounding);
  } else {
    cut.above = T.upper_bound();
  }
  if (cut.num_below == 0) {
    cut.below = singularity;
  } else {
    cut.below = T.Eigenvalue(
        cut.num_below - 1, T.lower_bound(), cut.threshold, rounding);
    cut.below = std::max(cut.below, singularity);
  }
  return cut;
}

double GramStepScale(const SpectralFilter& filter, double unit) {
  return std::pow(unit, -filter.Exponent());
}

double ApplyCutFunction(const SpectralFilter& filter,
                        double lambda_max,
                        const Cut& cut,
                        bool parameter_side,
                        SpectralWorkspace* workspace) {
  Tridiagonal& T = workspace->tridiagonal;
  const GramFunction f(filter, workspace->unit, lambda_max);
  workspace->shifts.clear();
  workspace->coefficients.clear();
  if (f.is_damped_resolvent() && cut.num_below == 0) {
    // (T + damping)^-1 h = Im[-i (z - T)^-1 h] with z = -damping.
    workspace->shifts.emplace_back(f.singularity());
    workspace->coefficients.emplace_back(0.0, -1.0);
  } else {
    // Rounded eigenvalues may lie a little outside what was found.
    const double margin =
        4.0 * kEpsilon * std::max(T.upper_bound(), -T.lower_bound());
    const double gap = std::max(cut.above - cut.below, margin);
    const double below = cut.below + 0.1 * gap;
    const double above = std::max(cut.above - 0.1 * gap, below + 0.1 * gap);
    ContourQuadrature(cut.num_below == 0 ? cut.below : below,
                      above,
                      lambda_max * (1.0 + 1e-3) + gap,
                      kContourTolerance,
                      &workspace->nodes);
    for (const ContourNode& node : workspace->nodes) {
      workspace->shifts.push_back(node.z);
      workspace->coefficients.push_back(node.weight * f(node.z));
    }
  }
  FillSigns(T.size(), &workspace->perturbations);
  T.ApplyResolvents(workspace->shifts,
                    workspace->coefficients,
                    workspace->b,
                    &workspace->y,
                    &workspace->perturbations,
                    &workspace->changes);
  double squared_change = 0.0;
  for (int p = 0; p < Tridiagonal::kNumPerturbations; ++p) {
    workspace->change = workspace->changes.col(p);
    const double norm = StepNorm(parameter_side, workspace->change, workspace);
    squared_change += norm * norm / Tridiagonal::kNumPerturbations;
  }
  if (squared_change == 0.0) return 0.0;
  return kSampleSafety * BackwardError(T.size()) * lambda_max *
         std::sqrt(squared_change) /
         StepNorm(parameter_side, workspace->y, workspace);
}

GramResult FormGram(const SpectralProblem& problem,
                    SpectralRoute route,
                    SpectralWorkspace* workspace,
                    SpectralStepSummary* summary) {
  MatrixXd& K = workspace->gram;
  if (route == SpectralRoute::kParameterGram) {
    problem.J.ParameterGram(&K);
  } else {
    problem.J.Gram(&K);
  }
  // A diagonal entry is the squared norm of a row or column of J: it is not
  // finite if any entry of that is not, or if a square overflows.
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
    problem.J.TransposeTimes(problem.g, &workspace->product);
    if (workspace->product.isZero(0.0)) return GramResult::kZero;
    summary->message = "the squares of J's entries underflow";
    return GramResult::kFailed;
  }
  // Numbers of ordinary size are reduced as they are, which saves a pass.
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (std::abs(exponent) <= 100) exponent = 0;
  workspace->unit = std::ldexp(1.0, exponent);
  if (exponent != 0) K.triangularView<Eigen::Lower>() *= 1.0 / workspace->unit;
  return GramResult::kDone;
}

bool GramIsReduced(const SpectralProblem& problem) {
  return std::min(problem.m(), problem.n()) >= kSmallestReduced &&
         !problem.filter.clamp;
}

bool GramRoute(const SpectralProblem& problem,
               SpectralRoute route,
               SpectralWorkspace* workspace,
               VectorXd* d,
               SpectralStepSummary* summary) {
  summary->route = route;
  switch (FormGram(problem, route, workspace, summary)) {
    case GramResult::kFailed:
      return false;
    case GramResult::kZero:
      d->setZero(problem.n());
      return true;
    case GramResult::kDone:
      break;
  }
  if (route == SpectralRoute::kParameterGram) {
    problem.J.TransposeTimes(problem.g, &workspace->b);
  } else {
    workspace->b = problem.g;
  }
  if (workspace->gram.rows() < kSmallestReduced || problem.filter.clamp) {
    return EigenvectorStep(problem, route, workspace, d, summary);
  }
  workspace->reduction.Compute(&workspace->gram);
  workspace->tridiagonal.Set(workspace->reduction.diagonal(),
                             workspace->reduction.off_diagonal());
  workspace->reduction.ApplyQTranspose(&workspace->b);
  return ReducedStep(problem, route, workspace, d, summary);
}

}  // namespace invgrad
