#include "invgrad/spectral/routes/spectrum_cut.h"

#include <algorithm>
#include <limits>

namespace invgrad {

double RoundingOf(const Tridiagonal& T) {
  return 4.0 * std::numeric_limits<double>::epsilon() *
         std::max(T.upper_bound(), -T.lower_bound());
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
  cut.above =
      cut.num_below < T.size()
          ? T.Eigenvalue(cut.num_below, threshold, T.upper_bound(), rounding)
          : T.upper_bound();
  cut.below = singularity;
  if (cut.num_below > 0) {
    cut.below = std::max(
        singularity,
        T.Eigenvalue(cut.num_below - 1, T.lower_bound(), threshold, rounding));
  }
  return cut;
}

}  // namespace invgrad
