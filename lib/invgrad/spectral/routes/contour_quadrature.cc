#include "invgrad/spectral/routes/contour_quadrature.h"

#include <array>
#include <cmath>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// Jacobi's elliptic functions of real arguments, by the arithmetic-geometric
// mean [Abramowitz, Stegun. Handbook of Mathematical Functions, 16.4].
class RealJacobi {
 public:
  // The complement k_prime = sqrt(1 - k^2) in (0, 1) replaces the modulus k,
  // because it is accurate for k close to 1.
  explicit RealJacobi(double k_prime) : k_prime_(k_prime) {
    double a = 1.0;
    double b = k_prime;
    double c = std::sqrt((1.0 - k_prime) * (1.0 + k_prime));
    a_[0] = a;
    c_[0] = c;
    while (c > 1e-9 * a && last_ + 1 < kMaxSteps) {  // c is squared each time
      c = 0.5 * (a - b);
      const double mean = 0.5 * (a + b);
      b = std::sqrt(a * b);
      a = mean;
      ++last_;
      a_[last_] = a;
      c_[last_] = c;
    }
    // The mean converges quadratically: b and a now agree to all digits.
    quarter_period_ = 0.5 * M_PI / (0.5 * (a + b));
  }

  double quarter_period() const { return quarter_period_; }  // K

  void operator()(double x, double* sn, double* cn, double* dn) const {
    double phi = std::ldexp(a_[last_] * x, last_);
    for (int i = last_; i > 0; --i) {
      phi = 0.5 * (phi + std::asin(c_[i] / a_[i] * std::sin(phi)));
    }
    *sn = std::sin(phi);
    *cn = std::cos(phi);
    // dn^2 = 1 - k^2 sn^2, without cancellation.
    *dn = std::hypot(k_prime_, c_[0] * *cn);
  }

 private:
  static constexpr int kMaxSteps = 16;
  std::array<double, kMaxSteps> a_{};
  std::array<double, kMaxSteps> c_{};
  int last_ = 0;
  double k_prime_;
  double quarter_period_;
};

}  // namespace

void ContourQuadrature(double below,
                       double above,
                       double upper,
                       double tolerance,
                       std::vector<ContourNode>* nodes) {
  CHECK_LT(below, above);
  CHECK_LT(above, upper);
  CHECK(tolerance > 0.0 && tolerance < 1.0) << tolerance;
  using Complex = std::complex<double>;
  const double smallest = above - below;  // m and M of [1]
  const double largest = upper - below;
  const double log_kappa = std::log(largest) - std::log(smallest);
  const int num_nodes = static_cast<int>(
      std::ceil(-std::log(tolerance) * (log_kappa + 3.0) / (M_PI * M_PI)));

  // k = (r - 1) / (r + 1) with r = sqrt(M / m), and its complement.
  const double root = std::exp(0.5 * log_kappa);
  const double k = (root - 1.0) / (root + 1.0);
  const double k_prime = 2.0 * std::sqrt(root) / (root + 1.0);
  const double geometric_mean = std::sqrt(smallest) * std::sqrt(largest);
  const RealJacobi jacobi(k_prime);
  const double step = 2.0 * jacobi.quarter_period() / num_nodes;
  // Elliptic functions of modulus k' at Im t, half their quarter period.
  const double s1 = std::sqrt(1.0 / (1.0 + k));
  const double c1 = std::sqrt(k / (1.0 + k));
  const double d1 = std::sqrt(k);

  nodes->resize(num_nodes);
  for (int j = 0; 2 * j < num_nodes; ++j) {
    // t = x + i K' / 2, x in (0, 2 K); the other half by the symmetry
    // zeta(2 K - conj(t)) = m M / conj(zeta(t)).
    double s;
    double c;
    double d;
    jacobi((j + 0.5) * step, &s, &c, &d);
    const double denominator = c1 * c1 + k * k * s * s * s1 * s1;
    const Complex sn = Complex(s * d1, c * d * s1 * c1) / denominator;
    const Complex cn = Complex(c * c1, -s * d * s1 * d1) / denominator;
    const Complex dn = Complex(d * c1 * d1, -k * k * s * c * s1) / denominator;
    const Complex ratio = (dn + k * cn) / k_prime;
    const Complex near = geometric_mean / (ratio * ratio);
    const Complex far = geometric_mean * std::conj(ratio * ratio);
    // -(1 / pi) d zeta: t runs clockwise around the interval.
    // sn(2 K - conj(t)) = conj(sn(t)).
    const Complex factor = -2.0 * k * step / M_PI * sn;
    (*nodes)[j] = {below + near, factor * near};
    (*nodes)[num_nodes - 1 - j] = {below + far, std::conj(factor) * far};
  }
}

}  // namespace invgrad
