// Nodes and weights that apply an analytic function to a part of a spectrum.
//
//   sum_j Im[weight_j f(z_j) / (z_j - x)]  ~  f(x)   for x in [above, upper],
//                                             0      for x <= below
//
// The midpoint rule for Cauchy's integral around [above, upper], on a circle of
// the annulus to which elliptic functions map the plane without (-inf, below]
// and [above, upper] [1, Method 1]. f must be analytic outside (-inf, below] and
// real on the real axis, so the nodes in the upper half-plane suffice.
//
// Cost:    (log(1 / tolerance) (log(kappa) + 3)) / pi^2 nodes, kappa =
//          (upper - below) / (above - below). For tolerance 1e-14: 33 nodes for
//          kappa = 1e3, 78 for 1e9, 123 for 1e15.
// Accuracy: 4 tolerance and a few roundings, relative to the largest |f| on the
//          contour, which is at most twice that at `above` for spectral filters.
//          If f is singular at `below`, this holds for x at least
//          above - below away from `below`; at x = below the error may be 2000
//          tolerance (for 1 / x).
//
// [1] Hale, Higham, Trefethen. Computing A^alpha, log(A), and related matrix
//     functions by contour integrals. SIAM J. Numer. Anal. 46 (2008), 2505.
//     Here the nodes are z = below + zeta with the logarithmic form of the map,
//     d zeta / dt = 2 k sn(t) zeta, which has no cancellation.
#ifndef INVGRAD_SPECTRAL_ROUTES_CONTOUR_QUADRATURE_H_
#define INVGRAD_SPECTRAL_ROUTES_CONTOUR_QUADRATURE_H_

#include <complex>
#include <vector>

namespace invgrad {

struct ContourNode {
  std::complex<double> z;       // Im z > 0
  std::complex<double> weight;  // factor of f(z) / (z - x)
};

// Reuses the memory of *nodes.
void ContourQuadrature(double below,
                       double above,
                       double upper,
                       double tolerance,
                       std::vector<ContourNode>* nodes);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_CONTOUR_QUADRATURE_H_
