#include "problems/heat.h"

#include <cmath>
#include <complex>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/methods/method.h"
#include "problems/fourier_grid.h"
#include "problems/heat_states.h"
#include "problems/problems.h"
#include "problems/spectral_diffusion.h"
#include "tests/support/create_problem.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Shape {
  int rows;
  int cols;
};

// One dimension and two, even and odd sides, sides of different length.
const Shape kShapes[] = {{1, 16}, {1, 9}, {8, 8}, {5, 7}, {6, 9}, {9, 4}};

VectorXd RandomField(int size, int seed) {
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  VectorXd x(size);
  for (double& value : x) value = random.Uniform(-1.0, 1.0);
  return x;
}

// cos(k . j + phase) for m waves along each axis.
VectorXd Wave(const Shape& shape, int m_0, int m_1, double phase) {
  VectorXd x(shape.rows * shape.cols);
  for (int i = 0; i < shape.rows; ++i) {
    for (int j = 0; j < shape.cols; ++j) {
      x[shape.cols * i + j] = std::cos(
          2.0 * M_PI *
              (1.0 * m_0 * i / shape.rows + 1.0 * m_1 * j / shape.cols) +
          phase);
    }
  }
  return x;
}

double SquaredWaveNumber(const Shape& shape, int m_0, int m_1) {
  return std::pow(2.0 * M_PI * m_0 / shape.rows, 2) +
         std::pow(2.0 * M_PI * m_1 / shape.cols, 2);
}

std::shared_ptr<const SpectralDiffusion> MakeDiffusion(const Shape& shape,
                                                       double diffusion) {
  return std::make_shared<SpectralDiffusion>(
      std::make_shared<FourierGrid>(shape.rows, shape.cols), diffusion);
}

VectorXd Outputs(const Simulator& simulator, const VectorXd& x) {
  VectorXd y(simulator.num_outputs());
  EXPECT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), nullptr));
  return y;
}

VectorXd Inverted(const InverseSimulator& inverse,
                  const VectorXd& y,
                  const VectorXd& x0) {
  VectorXd x;
  std::string why;
  EXPECT_TRUE(inverse.Invert(y, x0, VectorXd(), &x, &why)) << why;
  return x;
}

TEST(FourierGrid, IsTheSumOfItsHeaderAndItsInverse) {
  for (const Shape& shape : kShapes) {
    const FourierGrid grid(shape.rows, shape.cols);
    const VectorXd x = RandomField(grid.num_cells(), 1);
    std::vector<std::complex<double>> modes(grid.num_modes());
    grid.Forward(x.data(), modes.data());
    for (int m_0 = 0; m_0 < shape.rows; ++m_0) {
      for (int m_1 = 0; m_1 <= shape.cols / 2; ++m_1) {
        const int mode = m_0 * (shape.cols / 2 + 1) + m_1;
        const std::complex<double> sum(
            Wave(shape, m_0, m_1, 0.0).dot(x),
            Wave(shape, m_0, m_1, 0.5 * M_PI).dot(x));
        EXPECT_LT(std::abs(modes[mode] - sum), 1e-13) << m_0 << ", " << m_1;
        const int centred = 2 * m_0 < shape.rows ? m_0 : m_0 - shape.rows;
        EXPECT_NEAR(grid.squared_wave_numbers()[mode],
                    SquaredWaveNumber(shape, centred, m_1),
                    1e-13);
      }
    }
    VectorXd again(grid.num_cells());
    grid.Backward(modes.data(), again.data());
    EXPECT_LT((again - x).norm(), 1e-14);
  }
}

TEST(SpectralDiffusion, WavesDecayByTheClosedForm) {
  const double diffusion = 0.3;
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, diffusion);
    for (int m_0 = 0; 2 * m_0 < shape.rows; ++m_0) {
      for (int m_1 = 0; 2 * m_1 < shape.cols; ++m_1) {
        const VectorXd x = Wave(shape, m_0, m_1, 0.7);
        const double decay =
            std::exp(-diffusion * SquaredWaveNumber(shape, m_0, m_1));
        EXPECT_LT((Outputs(*simulator, x) - decay * x).norm(), 1e-14)
            << m_0 << ", " << m_1;
      }
    }
  }
}

TEST(SpectralDiffusion, ConservesTheMeanAndShrinksTheNorm) {
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, 2.0);
    const VectorXd x = RandomField(simulator->num_inputs(), 2);
    const VectorXd y = Outputs(*simulator, x);
    EXPECT_NEAR(y.mean(), x.mean(), 1e-15);
    EXPECT_LT(y.norm(), x.norm());
  }
}

// P_a P_b = P_(a + b), P_0 = 1.
TEST(SpectralDiffusion, TimesAdd) {
  for (const Shape& shape : kShapes) {
    const VectorXd x = RandomField(shape.rows * shape.cols, 3);
    const VectorXd twice = Outputs(*MakeDiffusion(shape, 0.5),
                                   Outputs(*MakeDiffusion(shape, 0.2), x));
    EXPECT_LT((twice - Outputs(*MakeDiffusion(shape, 0.7), x)).norm(), 1e-14);
    EXPECT_LT((x - Outputs(*MakeDiffusion(shape, 0.0), x)).norm(), 1e-14);
  }
}

TEST(SpectralDiffusion, IsSymmetric) {
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, 0.4);
    const VectorXd x = RandomField(simulator->num_inputs(), 4);
    const VectorXd z = RandomField(simulator->num_inputs(), 5);
    EXPECT_NEAR(
        Outputs(*simulator, x).dot(z), x.dot(Outputs(*simulator, z)), 1e-14);
  }
}

TEST(SpectralDiffusion, CommutesWithShifts) {
  const Shape shape = {6, 9};
  const auto simulator = MakeDiffusion(shape, 0.4);
  const auto shifted = [&](const VectorXd& x) {
    VectorXd result(x.size());
    for (int i = 0; i < shape.rows; ++i) {
      for (int j = 0; j < shape.cols; ++j) {
        result[shape.cols * ((i + 2) % shape.rows) + (j + 5) % shape.cols] =
            x[shape.cols * i + j];
      }
    }
    return result;
  };
  const VectorXd x = RandomField(simulator->num_inputs(), 6);
  EXPECT_LT((Outputs(*simulator, shifted(x)) - shifted(Outputs(*simulator, x)))
                .norm(),
            1e-14);
}

// P is linear, so that J x = P x exactly and P's own differences say no more.
TEST(SpectralDiffusion, JacobianIsTheMap) {
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, 0.4);
    const int size = simulator->num_inputs();
    const VectorXd x = RandomField(size, 7);
    VectorXd y(size);
    RowMajorMatrix J(size, size);
    ASSERT_TRUE(simulator->Evaluate(x.data(), nullptr, y.data(), J.data()));
    EXPECT_EQ(y, Outputs(*simulator, x));
    EXPECT_LT((J * x - y).norm(), 1e-14);
    for (int i = 0; i < size; ++i) {
      const VectorXd unit = VectorXd::Unit(size, i);
      EXPECT_LT((J.col(i) - Outputs(*simulator, unit)).norm(), 1e-14);
    }
    EXPECT_LT((J - J.transpose()).norm(), 1e-14);
  }
}

// The continuous heat kernel is positive: no new extremes. On a grid that holds
// for states whose spectrum it resolves, and once diffusion has cut it off:
// exp(-2 pi^2) = 3e-9 is left of the highest mode here.
TEST(SpectralDiffusion, MakesNoNewExtremes) {
  const Shape shape = {32, 32};
  const auto simulator = MakeDiffusion(shape, 2.0);
  const VectorXd x = RandomField(simulator->num_inputs(), 8);
  const VectorXd y = Outputs(*simulator, x);
  EXPECT_LT(y.maxCoeff(), x.maxCoeff());
  EXPECT_GT(y.minCoeff(), x.minCoeff());
  const VectorXd impulse = VectorXd::Unit(simulator->num_inputs(), 100);
  EXPECT_GT(Outputs(*simulator, impulse).minCoeff(), -1e-8);
}

TEST(SpectralDiffusion, FailsWhereAValueIsNotFinite) {
  const auto simulator = MakeDiffusion({4, 4}, 1.0);
  VectorXd x = VectorXd::Zero(16);
  x[3] = NAN;
  VectorXd y(16), x_bar(16);
  EXPECT_FALSE(simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
  const auto ones = [](const double*, double* w) {
    std::fill_n(w, 16, 1.0);
    return true;
  };
  EXPECT_FALSE(
      simulator->PullBack(x.data(), nullptr, ones, y.data(), x_bar.data()));
  x[3] = 0.0;
  EXPECT_TRUE(
      simulator->PullBack(x.data(), nullptr, ones, y.data(), x_bar.data()));
  EXPECT_FALSE(simulator->PullBack(
      x.data(),
      nullptr,
      [](const double*, double*) { return false; },
      y.data(),
      x_bar.data()));
}

TEST(SpectralDiffusion, GivesTheSameBitsInEveryThreadAndAtEveryAddress) {
  const auto simulator = MakeDiffusion({16, 16}, 0.5);
  const VectorXd x = RandomField(256, 9);
  const VectorXd y = Outputs(*simulator, x);
  std::vector<VectorXd> results(4);
  std::vector<std::thread> threads;
  for (size_t offset = 0; offset < results.size(); ++offset) {
    threads.emplace_back([&, offset]() {
      for (int repeat = 0; repeat < 100; ++repeat) {
        VectorXd memory(256 + offset), outputs(256 + offset);
        memory.tail(256) = x;
        if (!simulator->Evaluate(memory.data() + offset,
                                 nullptr,
                                 outputs.data() + offset,
                                 nullptr)) {
          return;
        }
        results[offset] = outputs.tail(256);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const VectorXd& result : results) EXPECT_EQ(result, y);
}

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

// A cell holds the mean over its area, so a coarse grid holds the means of a
// fine one.
TEST(HeatStates, AreTheSameOnEveryGrid) {
  const MatrixXd fine = RandomHeatStates(20, 64, 64, 5);
  const MatrixXd coarse = RandomHeatStates(20, 16, 16, 5);
  for (int s = 0; s < 20; ++s) {
    for (int i = 0; i < 16; ++i) {
      for (int j = 0; j < 16; ++j) {
        double mean = 0.0;
        for (int p = 4 * i; p < 4 * i + 4; ++p) {
          mean += fine.row(s).segment(64 * p + 4 * j, 4).sum() / 16.0;
        }
        EXPECT_NEAR(coarse(s, 16 * i + j), mean, 1e-14);
      }
    }
  }
}

// Means over the distribution: 7 rectangles of strength 1/2 and half sizes of
// mean 5, so of mean area (10)^2 in two dimensions and length 10 in one.
TEST(HeatStates, HaveTheMeanHeatOfTheirDistribution) {
  const MatrixXd plane = RandomHeatStates(4000, 8, 8, 6);
  const MatrixXd line = RandomHeatStates(4000, 1, 64, 6);
  EXPECT_GE(plane.minCoeff(), 0.0);
  EXPECT_GE(line.minCoeff(), 0.0);
  // A state's heat has a standard deviation below its mean: 1 / sqrt(4000) of
  // it, four times.
  EXPECT_NEAR(plane.mean(), 7 * 0.5 * 100.0 / 4096.0, 0.064 * 0.0854);
  EXPECT_NEAR(line.mean(), 7 * 0.5 * 10.0 / 64.0, 0.064 * 0.547);
}

// Every rectangle lies in the box, so that the heat is the sum of strength
// times area, of the numbers that the header says are drawn.
TEST(HeatStates, HoldTheHeatOfTheirRectangles) {
  NumpyRandom random(7);
  const MatrixXd states = RandomHeatStates(50, 16, 16, 7);
  for (int s = 0; s < 50; ++s) {
    const int num_rectangles = static_cast<int>(4.0 + 7.0 * random.Rand());
    double heat = 0.0;
    for (int i = 0; i < 10; ++i) {
      random.Rand(1, 2);  // positions
      const MatrixXd half_sizes = 10.0 * random.Rand(1, 2);
      const double strength = random.Rand();
      if (i < num_rectangles) heat += strength * 4.0 * half_sizes.prod();
    }
    EXPECT_NEAR(states.row(s).sum() * 16.0, heat, 1e-11);
  }
}

TEST(Heat, TargetsAreDiffusedStatesAndDecayIsThatOfTheBox) {
  for (const int n : {16, 32}) {
    // Two waves across a box of 64, at nu t = 8.
    const VectorXd wave = Wave({n, n}, 0, 2, 0.0);
    MatrixXd data(2, n * n);
    data.row(0) = wave.transpose();
    data.row(1).setOnes();
    const LearningProblem problem = CreateLearningProblem(
        "heat:num_samples=1:resolution=" + std::to_string(n), &data);
    const double decay = std::exp(-8.0 * std::pow(2.0 * M_PI * 2.0 / 64.0, 2));
    EXPECT_LT((problem.train.targets.col(0) - decay * wave).norm(), 1e-13);
    EXPECT_LT((problem.test.targets.col(0) - VectorXd::Ones(n * n)).norm(),
              1e-13);
  }
}

TEST(Heat, MetricIsTheDistanceFromTheTrueStates) {
  for (const char* name : {"heat", "heat_1d"}) {
    const LearningProblem problem = CreateLearningProblem(
        std::string(name) + ":num_samples=5:resolution=8");
    ASSERT_TRUE(problem.metric.has_value());
    EXPECT_EQ(problem.metric->name, "x_l1");
    const MatrixXd truth = problem.data.transpose();
    const auto distance = [&](const MatrixXd& x, const DataSet& data) {
      return problem.metric->evaluate(x, data);
    };
    EXPECT_EQ(distance(truth.leftCols(5), problem.train), 0.0);
    EXPECT_EQ(distance(truth.rightCols(5), problem.test), 0.0);
    // In any order, and for a part.
    const DataSet part = problem.train.Select({4, 1});
    MatrixXd x(truth.rows(), 2);
    x.col(0) = truth.col(4);
    x.col(1) = truth.col(1).array() - 0.5;
    EXPECT_NEAR(distance(x, part), 0.25, 1e-15);
  }
}

// What learns from the true states finds them in the data.
TEST(Heat, TakesMethodsThatLearnFromSolutions) {
  for (const char* name : {"heat", "heat_1d"}) {
    const LearningProblem problem = CreateLearningProblem(
        std::string(name) + ":num_samples=8:resolution=4");
    for (const char* method : {"supervised", "physics_informed"}) {
      SCOPED_TRACE(std::string(name) + ", " + method);
      std::vector<Method> methods;
      std::string error;
      const auto distance = [&](const VectorXd& weights) {
        DenseNetwork::Activations forward;
        EXPECT_TRUE(problem.model->Forward(
            weights, problem.train, false, &forward, &error));
        return problem.metric->evaluate(forward.outputs, problem.train);
      };
      const double at_start = distance(InitialWeights(problem));
      TrainOptions options;
      options.max_num_steps = 200;
      options.batch_size = 0;
      const TrainResult result = TrainProblem(problem, method, options);
      EXPECT_EQ(result.summary.num_steps, 200) << result.summary.message;
      EXPECT_LT(distance(result.weights), 0.5 * at_start);
    }
  }
}

// From the network's own x, the problem's inverse goes to the true state.
TEST(Heat, InverseRestoresTheStatesOfAMildCase) {
  const LearningProblem problem = CreateLearningProblem(
      "heat:num_samples=4:nu_t=1:absolute_uncertainty=1e-12:"
      "relative_uncertainty=0");
  for (int n = 0; n < 4; ++n) {
    const VectorXd x = Inverted(
        *problem.inverse, problem.train.targets.col(n), RandomField(256, n));
    EXPECT_LT((x - problem.data.row(n).transpose()).norm(), 1e-10);
  }
}

TEST(Heat, RefusesDataOfAnotherSize) {
  const MatrixXd data = MatrixXd::Zero(4, 63);
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem("heat_1d:resolution=64", &data, &problem, &error));
  EXPECT_NE(error.find("(2 samples or more, 64), found (4, 63)"),
            std::string::npos)
      << error;
}

}  // namespace
}  // namespace invgrad
