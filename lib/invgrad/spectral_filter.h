// The function phi of the singular values, which defines a joint rule.
//
//   step = -eta V phi(S) U^T g,   J = U S V^T
//
//   phi(s) = s (s^2 + lambda)^(-(1 + kappa) / 2) x^a / (x^a + noise)
//                                                  for s > tau s_max, else 0
//   lambda = damping + relative_damping s_max^2,   x = (s / s_max)^2
//
//   rule                         phi(s)
//   gradient descent             s               kappa = -1, tau = 0
//   half-inverse                 s^(-1/2)        kappa = 1/2, lambda = 0
//   truncated Gauss-Newton       s^-1            kappa = 1, lambda = 0
//   power, kappa in [-1, 1]      s^-kappa        lambda = 0
//   Levenberg-Marquardt          s / (s^2 + lambda)       kappa = 1, tau = 0
//   clamped                      phi(max(s, tau s_max))
//
// The last factor is a Wiener filter: the share of signal in a coefficient of g
// whose signal has the variance x^a in units in which its noise has the variance
// `noise` (rules/evidence.h estimates both). It is 1 for noise = 0.
//
// With damping, phi acts as gradient descent on values well below sqrt(lambda),
// and as a power on values well above. Truncation is relative and strict: a
// singular value equal to tau s_max is dropped. A zero singular value never
// contributes, not even clamped, because its singular vectors are not unique.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022, section 2. arXiv 2203.10131.
#ifndef INVGRAD_SPECTRAL_FILTER_H_
#define INVGRAD_SPECTRAL_FILTER_H_

#include <cmath>
#include <string>

namespace invgrad {

struct SpectralFilter {
  double kappa = 0.5;             // in [-1, 1]
  double tau = 1e-6;              // in [0, 1)
  bool clamp = false;             // raise small values to tau s_max instead
  double damping = 0.0;           // >= 0, in units of s^2
  double relative_damping = 0.0;  // >= 0, in units of s_max^2
  double noise = 0.0;             // >= 0, in units of the largest signal
  double signal_exponent = 1.0;   // a in (0, 1]

  static SpectralFilter Power(double kappa, double tau);
  static SpectralFilter HalfInverse(double tau) { return Power(0.5, tau); }
  static SpectralFilter GaussNewton(double tau) { return Power(1.0, tau); }
  static SpectralFilter GradientDescent() { return Power(-1.0, 0.0); }
  static SpectralFilter LevenbergMarquardt(double damping,
                                           double relative_damping);

  // Returns false, with *error, if a field is out of its range.
  bool IsValid(std::string* error) const;

  // lambda > 0: phi goes to zero with s, and is smooth there.
  bool IsDamped() const { return damping > 0.0 || relative_damping > 0.0; }

  // (1 + kappa) / 2: phi(s) = s f(s^2) with f(x) = (x + lambda)^-Exponent().
  double Exponent() const { return 0.5 * (1.0 + kappa); }

  // The share of signal x^a / (x^a + noise) at x, real or complex.
  template <typename T>
  T SignalShare(T x) const {
    using std::pow;
    const T signal = signal_exponent == 1.0 ? x : pow(x, signal_exponent);
    return signal / (signal + noise);
  }

  // The argument of the maximum of phi on (0, highest]; `highest` if phi is
  // singular at zero. With damping and noise, the smaller of their arguments.
  double PeakBelow(double highest, double s_max) const;

  // True if phi(s) = s, which needs no factorization of J.
  bool IsGradientDescent() const;

  // True if s is neither truncated nor clamped.
  bool Keeps(double s, double s_max) const;

  // phi(s), 0 <= s <= s_max.
  double operator()(double s, double s_max) const;

 private:
  // sqrt(lambda), without squares that over- or underflow.
  double RootOfDamping(double s_max) const;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_FILTER_H_
