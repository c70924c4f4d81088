// Against std::pow, over the whole spectrum.
#include "invgrad/spectral/routes/fractional_power.h"

#include <cmath>

#include "gtest/gtest.h"

namespace invgrad {
namespace fractional_power_test {

// The largest relative error over the spectrum, ends included.
double WorstError(const FractionalPower& power,
                  double p,
                  double lambda_min,
                  double lambda_max) {
  double worst = 0.0;
  constexpr int kPoints = 400;
  for (int i = 0; i <= kPoints; ++i) {
    const double lambda =
        lambda_min * std::pow(lambda_max / lambda_min, i / double{kPoints});
    worst =
        std::fmax(worst, std::abs(power(lambda) * std::pow(lambda, p) - 1.0));
  }
  return worst;
}

TEST(FractionalPower, IsWithinItsToleranceEverywhere) {
  for (const double p : {0.01, 0.25, 0.5, 0.75, 0.99}) {
    for (const double tolerance : {1e-1, 1e-2, 1e-6, 1e-10}) {
      const FractionalPower power =
          FractionalPower::Make(p, 1e-9, 3e2, tolerance);
      const double error = WorstError(power, p, 1e-9, 3e2);
      EXPECT_LE(error, tolerance) << "p " << p;
      EXPECT_LE(power.error_bound, tolerance);
    }
  }
}

// The bound is that of the trapezoidal rule, not of something far better: with
// the tolerance, the number of nodes has to grow.
TEST(FractionalPower, NodesGrowWithTheLogarithms) {
  const auto num_nodes = [](double condition, double tolerance) {
    return static_cast<double>(
        FractionalPower::Make(0.75, 1.0, condition, tolerance).nodes.size());
  };
  // One more for every factor exp(h) of the condition number: the counts are
  // log(120 condition) / h, rounded.
  const double by_condition =
      (num_nodes(1e12, 1e-4) - num_nodes(1e6, 1e-4)) / std::log(1e6);
  const double h =
      2.0 * M_PI * M_PI / std::asinh(4.0 * std::sin(0.75 * M_PI) / 1e-4);
  EXPECT_NEAR(by_condition, 1.0 / h, 1.0 / std::log(1e6));
  EXPECT_GT(num_nodes(1e6, 1e-8), 1.5 * num_nodes(1e6, 1e-3));
  // What a step with tau = 1e-3 in the place of truncation costs.
  EXPECT_LE(num_nodes(1e6, 1e-2), 9.0);
}

TEST(FractionalPower, ASingleEigenvalue) {
  const FractionalPower power = FractionalPower::Make(0.75, 5.0, 5.0, 1e-8);
  EXPECT_NEAR(power(5.0), std::pow(5.0, -0.75), 1e-8 * std::pow(5.0, -0.75));
}

TEST(FractionalPowerDeathTest, ChecksItsArguments) {
  EXPECT_DEATH(FractionalPower::Make(1.0, 1.0, 2.0, 1e-3), "p");
  EXPECT_DEATH(FractionalPower::Make(0.5, 0.0, 2.0, 1e-3), "lambda_min");
  EXPECT_DEATH(FractionalPower::Make(0.5, 3.0, 2.0, 1e-3), "lambda_min");
}

}  // namespace fractional_power_test
}  // namespace invgrad
