// The parts of the Gram route that the cascade shares with it.
//
//   K = J J^T (or J^T J) = unit Q T Q^T,   f(K) b = Q f(unit T) Q^T b
//
// with unit a power of two, so that T has entries of order one whatever J's
// units are. f(lambda) = phi(s) / s, lambda = s^2.
#ifndef INVGRAD_SPECTRAL_ROUTES_GRAM_ROUTE_H_
#define INVGRAD_SPECTRAL_ROUTES_GRAM_ROUTE_H_

#include "Eigen/Core"
#include "invgrad/spectral/routes/spectral_routes.h"

namespace invgrad {

enum class GramResult { kFailed, kZero, kDone };

// Fills workspace->gram with K / unit (its lower triangle) and ->unit. kZero:
// J, or J^T g, is zero. kFailed sets summary->message: J is not finite, or its
// squares over- or underflow.
GramResult FormGram(const SpectralProblem& problem,
                    SpectralRoute route,
                    SpectralWorkspace* workspace,
                    SpectralStepSummary* summary);

// After the reduction of workspace->gram: T's spectrum around a threshold.
struct Cut {
  double threshold = 0.0;  // eigenvalues above it are kept
  int num_below = 0;       // eigenvalues that are not
  int num_undecided = 0;   // nearer to the wanted threshold than `resolution`
  // No eigenvalue lies between: (-inf, below] and [above, lambda_max].
  double below = 0.0;
  double above = 0.0;
};

// The threshold nearest to `wanted` that lies in a gap of the spectrum:
// `wanted` itself, but for eigenvalues within `resolution` of it. f may be
// singular at `singularity` and below it.
Cut FindCut(const Tridiagonal& T,
            double wanted,
            double resolution,
            double singularity);

// workspace->y = f(unit T) h / GramStepScale for the eigenvalues that `cut`
// keeps, and 0 for the others; h is workspace->b. Returns the relative error of
// the step that a backward error of the reduction makes: its norm is that of
// sqrt(T) y or, on the parameter side, of y.
double ApplyCutFunction(const SpectralFilter& filter,
                        double lambda_max,
                        const Cut& cut,
                        bool parameter_side,
                        SpectralWorkspace* workspace);

// A power of the unit, which may be far from one.
double GramStepScale(const SpectralFilter& filter, double unit);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_GRAM_ROUTE_H_
