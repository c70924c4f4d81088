#include "invgrad/spectral/routes/stieltjes_quadrature.h"

#include <algorithm>
#include <cmath>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

constexpr double kPi = 3.14159265358979323846;

// sum_{i >= 0} exp(-rate i)
double GeometricSum(double rate) { return -1.0 / std::expm1(-rate); }

}  // namespace

void StieltjesQuadrature(double p,
                         double lower,
                         double upper,
                         double tolerance,
                         std::vector<StieltjesNode>* nodes) {
  CHECK(p > 0.0 && p <= 1.0) << p;
  CHECK(lower > 0.0 && lower <= upper && std::isfinite(upper))
      << lower << " " << upper;
  CHECK(tolerance > 0.0 && tolerance < 1.0) << tolerance;
  nodes->clear();
  if (p == 1.0) {
    nodes->push_back({0.0, 1.0});
    return;
  }
  // Half of the tolerance is the rule's, a quarter each tail's.
  const double h = 2.0 * kPi * kPi / std::log(10.0 / tolerance);
  // weight_j = scale z_j^(1 - p); sin(pi p) = sin(pi (1 - p)) without
  // cancellation.
  const double scale = h / kPi * std::sin(kPi * std::min(p, 1.0 - p));
  // The largest z with scale (z / lower)^q GeometricSum(q h) <= tolerance / 4:
  // the sum of weight z^2 / x^3 over the tail below, relative to x^-p.
  const auto reach = [&](double q) {
    return std::log(0.25 * tolerance / (scale * GeometricSum(q * h))) / q;
  };
  const double first = std::floor((std::log(lower) + reach(3.0 - p)) / h);
  // Likewise x^2 weight / z^3 over the tail above.
  const double last =
      std::max(first + 1.0, std::ceil((std::log(upper) - reach(2.0 + p)) / h));
  const auto power = [&](double j, double q) { return std::exp(q * j * h); };

  const double sum =
      scale * power(first, 1.0 - p) * GeometricSum((1.0 - p) * h);
  const double first_moment =
      scale * power(first, 2.0 - p) * GeometricSum((2.0 - p) * h);
  nodes->push_back({first_moment / sum, sum});
  for (double j = first + 1.0; j < last; j += 1.0) {
    nodes->push_back({power(j, 1.0), scale * power(j, 1.0 - p)});
  }
  // Of weight / z and weight / z^2.
  const double sum_above = scale * power(last, -p) * GeometricSum(p * h);
  const double moment_above =
      scale * power(last, -1.0 - p) * GeometricSum((1.0 + p) * h);
  const double z = sum_above / moment_above;
  nodes->push_back({z, z * sum_above});
}

}  // namespace invgrad
