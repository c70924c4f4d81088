#include "problems/heat_inverse.h"

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "problems/heat.h"
#include "problems/problems.h"
#include "tests/problems/heat_fields.h"

namespace invgrad {
namespace heat_inverse_test {

using Eigen::VectorXd;

TEST(HeatInverse, ActionFollowsTheProbabilityOfSignal) {
  const double u = 1e-3;
  // Far above the uncertainty, and not more than expected: all signal.
  EXPECT_NEAR(HeatInverse::Action(0.5, 1.0, u), 1.0, 1e-15);
  // Nothing is expected, and something is there: all noise.
  EXPECT_NEAR(HeatInverse::Action(10.0 * u, 1e-9, u), -1.0, 1e-15);
  EXPECT_EQ(HeatInverse::Action(10.0 * u, 0.0, u), -1.0);
  // Expected as much as uncertain: even odds.
  EXPECT_EQ(HeatInverse::Action(0.7, 0.2, 0.2), 0.0);
  EXPECT_EQ(HeatInverse::Action(0.0, 0.0, u), 0.0);
  // p = 0.68 where exp(1/2 (a / u)^2) = 0.68 / 0.32: no action just below it.
  const double edge = u * std::sqrt(2.0 * std::log(0.68 / 0.32));
  EXPECT_EQ(HeatInverse::Action(edge * (1.0 - 1e-6), 1e6, u), 0.0);
  EXPECT_NEAR(HeatInverse::Action(edge * (1.0 + 1e-6), 1e6, u), 0.36, 1e-5);
  // Both likelihoods underflow; their ratio does not.
  EXPECT_NEAR(HeatInverse::Action(100.0, 1.0, u), 1.0, 1e-15);
  EXPECT_NEAR(HeatInverse::Action(100.0, u, 1.0), -1.0, 1e-15);
  // So do squares of amplitudes, of what is expected and of 1 / u.
  EXPECT_EQ(HeatInverse::Action(1e-170, 0.0, 1e-8), -1.0);
  EXPECT_EQ(HeatInverse::Action(1e-170, 1e-200, 1e-8), -1.0);
  EXPECT_EQ(HeatInverse::Action(1e-10, 0.0, 1e-100), -1.0);
  EXPECT_EQ(HeatInverse::Action(1e80, 1e-90, 1e-100), 1.0);
}

// The smallest uncertainty that is allowed, where the weakest modes reach y by
// exp(-2000) = 0 and others by less than 1e-154, whose square is 0.
TEST(HeatInverse, IsFiniteAtTheSmallestUncertainty) {
  const auto simulator = MakeDiffusion({16, 16}, 100.0);
  const HeatInverse inverse(simulator, {0.0, HeatUncertainty::kMinAbsolute});
  const VectorXd y = RandomField(256, 15);
  const VectorXd zero = VectorXd::Zero(256);
  const VectorXd x = Inverted(inverse, y, zero);
  EXPECT_TRUE(x.allFinite());
  // Modes are amplified as the header says, by sqrt(N) / u = 1 / a at most.
  EXPECT_LT(x.norm(), 1.01 / HeatUncertainty::kMinAbsolute * y.norm());
  EXPECT_EQ(Inverted(inverse, zero, zero), zero);
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem(
      "heat_state:absolute_uncertainty=1e-200", nullptr, &problem, &error));
  EXPECT_NE(error.find("1e-100"), std::string::npos) << error;
}

TEST(HeatInverse, NeverAmplifiesAModeBelowTheUncertainty) {
  NumpyRandom random(10);
  int num_amplified = 0;
  for (int i = 0; i < 20000; ++i) {
    const double amplitude = std::pow(10.0, random.Uniform(-9.0, 3.0));
    const double expected = std::pow(10.0, random.Uniform(-12.0, 3.0));
    const double u = std::pow(10.0, random.Uniform(-9.0, 0.0));
    const double action = HeatInverse::Action(amplitude, expected, u);
    ASSERT_LE(std::abs(action), 1.0);
    if (action <= 0.0) continue;
    ++num_amplified;
    EXPECT_GT(amplitude, 1.22 * u);
    EXPECT_GT(expected, u);
  }
  EXPECT_GT(num_amplified, 1000);
}

// exp(-0.5 pi^2 2) = 5e-5 at the highest mode: all of them are signal.
TEST(HeatInverse, IsExactWhereDiffusionIsMild) {
  for (const Shape& shape : {Shape{16, 16}, Shape{1, 64}}) {
    const auto simulator = MakeDiffusion(shape, 0.5);
    const HeatInverse inverse(simulator, {0.0, 1e-14});
    const VectorXd x = RandomField(simulator->num_inputs(), 11);
    const VectorXd y = Outputs(*simulator, x);
    // Rounding of y, 1e-16, times 1 / 5e-5.
    EXPECT_LT((Inverted(inverse, y, VectorXd::Zero(x.size())) - x)
                  .lpNorm<Eigen::Infinity>(),
              1e-10);
  }
}

TEST(HeatInverse, StaysWhereTheTargetIsReached) {
  const auto simulator = MakeDiffusion({16, 16}, 8.0);
  const HeatInverse inverse(simulator, HeatUncertainty());
  const VectorXd x = RandomField(256, 12);
  EXPECT_LT((Inverted(inverse, Outputs(*simulator, x), x) - x).norm(), 1e-13);
}

// What y does not show of x_0 stays: the answer is the one close to x_0.
TEST(HeatInverse, IsLocal) {
  const Shape shape = {32, 32};
  const auto simulator = MakeDiffusion(shape, 8.0);
  const HeatInverse inverse(simulator, HeatUncertainty());
  // exp(-8 pi^2) = 5e-35 at m = (16, 0), and 0.5 at (1, 1).
  const VectorXd hidden = Wave(shape, 15, 0, 0.3);
  const VectorXd seen = Wave(shape, 1, 1, 0.0);
  const VectorXd x = Inverted(inverse, Outputs(*simulator, seen), hidden);
  EXPECT_LT((x - seen - hidden).norm(), 1e-5);
}

// Noise of 1e-4 a cell, announced as such. The exact inverse would multiply it
// by up to exp(8 2 pi^2) = 4e68.
TEST(HeatInverse, SuppressesNoise) {
  const Shape shape = {64, 64};
  const auto simulator = MakeDiffusion(shape, 8.0);
  const double noise = 1e-4;
  const HeatInverse inverse(simulator, {0.0, noise});
  const VectorXd x = RandomHeatStates(1, 64, 64, 3).transpose();
  const VectorXd zero = VectorXd::Zero(x.size());
  const VectorXd y = Outputs(*simulator, x);
  const VectorXd noisy_y = y + noise * RandomField(4096, 13);
  const VectorXd restored = Inverted(inverse, noisy_y, zero);
  // What is left is what the diffused state had to be restored from, and
  // better than that state itself.
  EXPECT_LT((restored - x).norm(), 0.75 * (y - x).norm());
  // Pure noise: hardly any of it is taken for signal.
  const VectorXd from_noise =
      Inverted(inverse, noise * RandomField(4096, 14), zero);
  EXPECT_LT(from_noise.norm(), 0.05 * x.norm());
}

// The cells' noise is U(-1, 1) 1e-4; no mode may grow by more than sqrt(N) / u.
TEST(HeatInverse, AmplifiesByLessThanTheBound) {
  const Shape shape = {32, 32};
  const auto simulator = MakeDiffusion(shape, 8.0);
  const FourierGrid& grid = simulator->grid();
  const HeatUncertainty uncertainty = {1e-6, 1e-5};
  const HeatInverse inverse(simulator, uncertainty);
  for (int seed = 0; seed < 20; ++seed) {
    const VectorXd y = 0.1 * RandomField(1024, seed);
    const VectorXd x = Inverted(inverse, y, VectorXd::Zero(1024));
    const double u =
        (uncertainty.relative * y.cwiseAbs().array() + uncertainty.absolute)
            .matrix()
            .norm();
    std::vector<std::complex<double>> from(grid.num_modes()),
        to(grid.num_modes());
    grid.Forward(y.data(), from.data());
    grid.Forward(x.data(), to.data());
    for (int k = 0; k < grid.num_modes(); ++k) {
      EXPECT_LE(std::abs(to[k]), std::abs(from[k]) * std::sqrt(1024.0) / u);
    }
  }
}

// The published case, single states of 64 x 64 cells at nu t = 8: repeated
// steps bring the loss to the square of the uncertainty and x nearer each time.
TEST(HeatInverse, RepeatedStepsRestoreAPublishedState) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(
      CreateProblem("heat_state:resolution=64", nullptr, &problem, &error))
      << error;
  const PointProblem& point = *problem.point;
  const VectorXd& truth = *point.minimizer;
  EXPECT_EQ(point.start, VectorXd::Zero(4096));
  VectorXd x = point.start;
  double distance = (point.target - truth).norm();
  for (int step = 0; step < 3; ++step) {
    x = Inverted(*point.inverse, point.target, x);
    EXPECT_LT((x - truth).norm(), distance);
    distance = (x - truth).norm();
  }
  // Modes that decay to less than u / sqrt(N) = 1e-8 cannot be known. All
  // others are there: what is missing is not more than what they leave.
  const SpectralDiffusion& simulator =
      dynamic_cast<const SpectralDiffusion&>(*point.simulator);
  const FourierGrid& grid = simulator.grid();
  std::vector<std::complex<double>> modes(grid.num_modes());
  grid.Forward(truth.data(), modes.data());
  for (int k = 0; k < grid.num_modes(); ++k) {
    if (simulator.exponents()[k] > 15.0) modes[k] = 0.0;
  }
  VectorXd knowable(4096);
  grid.Backward(modes.data(), knowable.data());
  EXPECT_LT(distance, 1.01 * (truth - knowable).norm());
}

TEST(HeatInverse, FailsWithAReason) {
  const auto simulator = MakeDiffusion({4, 4}, 1.0);
  const HeatInverse inverse(simulator, HeatUncertainty());
  EXPECT_FALSE(inverse.reaches_target());
  const VectorXd zero = VectorXd::Zero(16);
  VectorXd bad = zero;
  bad[0] = INFINITY;
  VectorXd x;
  std::string why;
  EXPECT_FALSE(inverse.Invert(bad, zero, VectorXd(), &x, &why));
  EXPECT_EQ(why, "the target is not finite");
  EXPECT_FALSE(inverse.Invert(zero, bad, VectorXd(), &x, &why));
  EXPECT_EQ(why, "the simulator has no finite value at x0");
}

}  // namespace heat_inverse_test
}  // namespace invgrad
