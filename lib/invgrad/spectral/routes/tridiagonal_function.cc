#include "invgrad/spectral/routes/tridiagonal_function.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using ComplexNumber = std::complex<double>;

constexpr double kRoundoff = std::numeric_limits<double>::epsilon();

// Tolerance of the quadrature, relative to the largest |f|.
constexpr double kContourTolerance = 1e-15;

// The root mean square over four random perturbations is hardly ever less than
// a third of the root mean square over all perturbations. One perturbation is
// not enough: if a single number determines the error (one value is kept, or
// one small value lies far from the others), this number may happen to be
// small.
constexpr double kSampleSafety = 3.0;

// A few roundings of the largest eigenvalue.
double RoundingOf(const Tridiagonal& T) {
  return 4.0 * kRoundoff * std::max(T.upper_bound(), -T.lower_bound());
}

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

}  // namespace

GramFunction::GramFunction(const SpectralFilter& filter,
                           double unit,
                           double lambda_max)
    : exponent_(filter.Exponent()),
      damping_(filter.damping / unit + filter.relative_damping * lambda_max),
      scale_(std::pow(unit, -filter.Exponent())) {}

ComplexNumber GramFunction::operator()(ComplexNumber z) const {
  return exponent_ == 1.0 ? 1.0 / (z + damping_)
                          : std::pow(z + damping_, -exponent_);
}

Cut FindCut(const Tridiagonal& T,
            double wanted,
            double resolution,
            double singularity) {
  Cut cut;
  const double rounding = RoundingOf(T);
  // The number of eigenvalues within the resolution and, if there are any, the
  // widest gap between them.
  constexpr int kProbes = 63;
  double probes[kProbes];
  int counts[kProbes];
  for (int k = 0; k < kProbes; ++k) {
    probes[k] = wanted + resolution * (2.0 * k / (kProbes - 1) - 1.0);
  }
  T.CountBelow(probes, kProbes, counts);
  cut.num_undecided = counts[kProbes - 1] - counts[0];
  double threshold = wanted;
  cut.num_below = counts[kProbes / 2];
  if (cut.num_undecided > 0) {
    int widest = 0;
    for (int first = 0; first < kProbes;) {
      int end = first + 1;
      while (end < kProbes && counts[end] == counts[first]) ++end;
      if (end - first > widest) {
        widest = end - first;
        threshold = probes[first + widest / 2];
        cut.num_below = counts[first];
      }
      first = end;
    }
  }
  // The eigenvalues on both sides. An eigenvalue far from the others need not
  // be accurate: the quadrature only needs a gap.
  if (cut.num_below < T.size()) {
    cut.above =
        T.Eigenvalue(cut.num_below, threshold, T.upper_bound(), rounding);
  } else {
    cut.above = T.upper_bound();
  }
  if (cut.num_below == 0) {
    cut.below = singularity;
  } else {
    cut.below =
        T.Eigenvalue(cut.num_below - 1, T.lower_bound(), threshold, rounding);
    cut.below = std::max(cut.below, singularity);
  }
  return cut;
}

double StepNorm(bool parameter_side,
                const Eigen::VectorXd& y,
                SpectralBuffers* buffers) {
  if (parameter_side) return y.norm();
  buffers->tridiagonal.Times(y, &buffers->product);
  return std::sqrt(std::abs(y.dot(buffers->product)));
}

double ApplyCutFunction(const GramFunction& f,
                        double lambda_max,
                        const Cut& cut,
                        bool parameter_side,
                        SpectralBuffers* buffers) {
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
    const double norm = StepNorm(parameter_side, buffers->change, buffers);
    squared_change += norm * norm / Tridiagonal::kNumPerturbations;
  }
  if (squared_change == 0.0) return 0.0;
  return kSampleSafety * BackwardError(T.size()) * lambda_max *
         std::sqrt(squared_change) /
         StepNorm(parameter_side, buffers->y, buffers);
}

}  // namespace invgrad
