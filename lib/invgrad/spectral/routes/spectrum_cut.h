// A threshold in the spectrum of a symmetric tridiagonal matrix, placed in a gap.
//
// Cost:    two eigenvalues by bisection and 63 eigenvalue counts.
#ifndef INVGRAD_SPECTRAL_ROUTES_SPECTRUM_CUT_H_
#define INVGRAD_SPECTRAL_ROUTES_SPECTRUM_CUT_H_

#include "invgrad/spectral/routes/tridiagonal.h"

namespace invgrad {

// A few roundings of the largest eigenvalue.
double RoundingOf(const Tridiagonal& T);

// A threshold in T's spectrum. No eigenvalue lies between `below` and `above`.
struct Cut {
  int num_below = 0;      // number of dropped eigenvalues
  int num_undecided = 0;  // within `resolution` of the wanted threshold
  double below = 0.0;     // the largest dropped eigenvalue, or f's singularity
  double above = 0.0;     // the smallest kept eigenvalue
};

// The threshold nearest to `wanted` that lies in a gap of the spectrum:
// `wanted` itself, unless eigenvalues are within `resolution` of it.
Cut FindCut(const Tridiagonal& T,
            double wanted,
            double resolution,
            double singularity);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_SPECTRUM_CUT_H_
