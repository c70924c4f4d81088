// The function phi of the singular values that tells the joint rules apart.
//
//   step = -eta V phi(S) U^T g,   J = U S V^T
//
//   rule                         phi(s)
//   gradient descent             s               (kappa = -1, tau = 0)
//   half-inverse                 s^(-1/2)        for s > tau s_max, else 0
//   truncated Gauss-Newton       s^-1            for s > tau s_max, else 0
//   power, kappa in [-1, 1]      s^-kappa        for s > tau s_max, else 0
//   Levenberg-Marquardt          s / (s^2 + lambda),
//                                lambda = damping + relative_damping s_max^2
//   clamped                      phi(max(s, tau s_max))
//
// Truncation is relative and strict: a singular value equal to tau s_max is
// dropped. It applies to Levenberg-Marquardt too, where tau = 0 by default. An
// exactly zero singular value never contributes, not even clamped: its singular
// vectors are not unique, so no direction belongs to it.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022, section 2. arXiv 2203.10131.
#ifndef INVGRAD_LINALG_SPECTRAL_FILTER_H_
#define INVGRAD_LINALG_SPECTRAL_FILTER_H_

#include <string>

namespace invgrad {

struct SpectralFilter {
  enum class Kind { kPower, kLevenbergMarquardt };

  Kind kind = Kind::kPower;
  double kappa = 0.5;             // in [-1, 1]
  double tau = 1e-6;              // in [0, 1)
  bool clamp = false;             // raise small values to tau s_max instead
  double damping = 0.0;           // >= 0, in units of s^2
  double relative_damping = 0.0;  // >= 0, in units of s_max^2

  static SpectralFilter Power(double kappa, double tau);
  static SpectralFilter HalfInverse(double tau) { return Power(0.5, tau); }
  static SpectralFilter GaussNewton(double tau) { return Power(1.0, tau); }
  static SpectralFilter GradientDescent() { return Power(-1.0, 0.0); }
  static SpectralFilter LevenbergMarquardt(double damping,
                                           double relative_damping);

  // False if a field is out of its range; then *error says which.
  bool IsValid(std::string* error) const;

  // True if phi(s) = s, which needs no factorization of J.
  bool IsGradientDescent() const;

  // True if s contributes as it is (and is not truncated or clamped).
  bool Keeps(double s, double s_max) const;

  // phi(s), 0 <= s <= s_max.
  double operator()(double s, double s_max) const;
};

}  // namespace invgrad

#endif  // INVGRAD_LINALG_SPECTRAL_FILTER_H_
