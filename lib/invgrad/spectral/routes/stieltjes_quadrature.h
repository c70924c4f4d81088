// A negative power as a positive sum of simple poles.
//
//   x^-p ~ sum_j weight_j / (x + z_j),   z_j >= 0,  weight_j > 0,  0 < p <= 1
//
// The trapezoidal rule in log z, with step h, for Stieltjes' formula
//
//   x^-p = (sin(pi p) / pi) int_0^inf z^-p / (x + z) dz
//
// Both tails, far below the smallest x and far above the largest, are one node
// each, which has the sum and the mean of its tail. p = 1 is the node z = 0 alone.
//
// Cost:    (log(upper / lower) + (2.7 to 4) log(1 / tolerance) / 2.75) / h nodes,
//          h = 2 pi^2 / log(10 / tolerance): for tolerance 1e-8 some 20 for
//          upper = lower, and one more for each factor of 2.6 between them.
// Accuracy: the relative error is at most `tolerance` for x in [lower, upper].
//          By Poisson's formula, the rule's own error is at most 4 e / (1 - e),
//          e = exp(-2 pi^2 / h); a tail's is at most its variance times half the
//          second derivative of 1 / (x + z) in z (of 1 / (1 + x t) in t = 1 / z,
//          for the masses weight / z): docs/leave_one_out.md, section 2.
// Grid:    z_j = exp(j h) but for the tails' two nodes: the same for all p and
//          all intervals, at one tolerance.
// Fails:   never; CHECKs that 0 < p <= 1, 0 < lower <= upper < infinity, and
//          0 < tolerance < 1.
#ifndef INVGRAD_SPECTRAL_ROUTES_STIELTJES_QUADRATURE_H_
#define INVGRAD_SPECTRAL_ROUTES_STIELTJES_QUADRATURE_H_

#include <vector>

namespace invgrad {

struct StieltjesNode {
  double z;
  double weight;
};

// Reuses the memory of *nodes.
void StieltjesQuadrature(double p,
                         double lower,
                         double upper,
                         double tolerance,
                         std::vector<StieltjesNode>* nodes);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_STIELTJES_QUADRATURE_H_
