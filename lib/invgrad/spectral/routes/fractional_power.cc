#include "invgrad/spectral/routes/fractional_power.h"

#include <cmath>

#include "glog/logging.h"

namespace invgrad {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The expansions are used at shifts that are this far outside the spectrum:
// products are cheap, so that the upper ones may be nearer.
constexpr double kLowerDistance = 30.0;
constexpr double kUpperDistance = 4.0;

// How many terms of an expansion in powers of 1 / distance leave out less than
// `tolerance`.
int NumTerms(double distance, double tolerance) {
  return static_cast<int>(std::ceil(-std::log(tolerance) / std::log(distance)));
}

}  // namespace

FractionalPower FractionalPower::Make(double p,
                                      double lambda_min,
                                      double lambda_max,
                                      double tolerance) {
  CHECK_GT(p, 0.0);
  CHECK_LT(p, 1.0);
  CHECK_GT(lambda_min, 0.0);
  CHECK_LE(lambda_min, lambda_max);
  CHECK_GT(tolerance, 0.0);
  CHECK_LT(tolerance, 1.0);

  FractionalPower power;
  const double sine = std::sin(kPi * p);
  // Half of the tolerance is the rule's, a quarter that of each expansion.
  const double h = 2.0 * kPi * kPi / std::asinh(4.0 * sine / tolerance);
  power.error_bound = tolerance;
  const double scale = h * sine / kPi;

  double u = std::log(lambda_min) - std::log(kLowerDistance) + h;
  const double first_below = u - h;
  const double end = std::log(lambda_max) + std::log(kUpperDistance);
  for (; u < end; u += h) {
    power.nodes.push_back({std::exp(u), scale * std::exp((1.0 - p) * u)});
  }
  // Sums of geometric series, over the nodes below and above.
  const int num_lower = NumTerms(kLowerDistance, 0.25 * tolerance);
  for (int k = 0; k < num_lower; ++k) {
    const double exponent = 1.0 - p + k;
    const double sum =
        std::exp(exponent * first_below) / -std::expm1(-exponent * h);
    power.lower_terms.push_back((k % 2 == 0 ? scale : -scale) * sum);
  }
  const int num_upper = NumTerms(kUpperDistance, 0.25 * tolerance);
  for (int k = 0; k < num_upper; ++k) {
    const double exponent = p + k;
    const double sum = std::exp(-exponent * u) / -std::expm1(-exponent * h);
    power.upper_terms.push_back((k % 2 == 0 ? scale : -scale) * sum);
  }
  return power;
}

double FractionalPower::operator()(double lambda) const {
  double sum = 0.0;
  for (const Node& node : nodes) sum += node.weight / (node.shift + lambda);
  double factor = 1.0 / lambda;
  for (const double term : lower_terms) {
    sum += term * factor;
    factor /= lambda;
  }
  factor = 1.0;
  for (const double term : upper_terms) {
    sum += term * factor;
    factor *= lambda;
  }
  return sum;
}

}  // namespace invgrad
