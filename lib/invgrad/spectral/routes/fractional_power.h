// Nodes for a fractional power of a positive definite matrix by real shifts.
//
//   A^-p b = w sum_j h exp((1 - p) u_j) (exp(u_j) I + A)^-1 b,   0 < p < 1
//   w = sin(pi p) / pi,   u_j = u_0 + j h,   j in Z
//
// the trapezoidal rule for A^-p = w int_0^inf t^-p (t I + A)^-1 dt, t = exp(u)
// [1]. As a function of u the integrand is analytic for |Im u| < pi and depends
// on an eigenvalue lambda by u - log(lambda) alone, so the relative error is
// the same for every eigenvalue, whatever the condition of A:
//
//   |error| <= 2 sin(pi p) / sinh(2 pi^2 / h)  relative to lambda^-p
//
// Of the infinite sum, shifts well between the ends of the spectrum need a
// factorization each. Those far below the smallest eigenvalue, and far above
// the largest, are summed up in closed form by the expansions
//
//   (t I + A)^-1 = sum_k (-t)^k A^-(k+1)          t < lambda_min
//   (t I + A)^-1 = sum_k t^-(k+1) (-A)^k          t > lambda_max
//
// which take one factorization of A, and products with A.
//
// Cost:    about log(10 lambda_max / lambda_min) / h + 2 nodes;
//          h = 3.3 for a relative error of 1e-2, 1.4 for 1e-6.
//
// [1] Bonito, Pasciak. Numerical approximation of fractional powers of elliptic
//     operators. Math. Comp. 84 (2015), section 3.
#ifndef INVGRAD_SPECTRAL_ROUTES_FRACTIONAL_POWER_H_
#define INVGRAD_SPECTRAL_ROUTES_FRACTIONAL_POWER_H_

#include <vector>

namespace invgrad {

struct FractionalPower {
  struct Node {
    double shift;   // exp(u_j)
    double weight;  // w h exp((1 - p) u_j)
  };
  std::vector<Node> nodes;          // of (shift I + A)^-1 b, shifts ascending
  std::vector<double> lower_terms;  // [k]: of A^-(k+1) b
  std::vector<double> upper_terms;  // [k]: of A^k b
  double error_bound = 0.0;         // relative, of every eigenvalue's power

  // For a spectrum in [lambda_min, lambda_max], 0 < lambda_min <= lambda_max,
  // p in (0, 1) and a relative error of at most `tolerance` in (0, 1) (all
  // CHECKed).
  static FractionalPower Make(double p,
                              double lambda_min,
                              double lambda_max,
                              double tolerance);

  // What the nodes make of lambda^-p.
  double operator()(double lambda) const;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_FRACTIONAL_POWER_H_
