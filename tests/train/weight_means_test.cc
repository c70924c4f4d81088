// Running means of the weights, and the runs that report them.

#include "invgrad/train/weight_means.h"

#include <array>
#include <cmath>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/train.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace weight_means_test {

using Eigen::VectorXd;

constexpr std::array<double, 3> kHorizons = {3.0, 10.0, 30.0};

// The mean of k weights that grow by one a step, the first of them 0:
// k - 1 - (h - 1) (1 - (1 - 1/h)^(k - 1)).
TEST(WeightMeans, LagBehindASteadyGrowthByTheirHorizonLessOne) {
  WeightMeans means;
  EXPECT_FALSE(means.has_means());
  for (int k = 0; k <= 500; ++k) {
    means.Add(VectorXd::Constant(2, k));
    ASSERT_TRUE(means.has_means());
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      const double h = kHorizons[i];
      const double expected =
          k - (h - 1.0) * (1.0 - std::pow(1.0 - 1.0 / h, k));
      EXPECT_NEAR(means.means()[i][1], expected, 1e-12 * (1.0 + k));
    }
  }
}

// The variance of the mean of independent values is that of one, times
// 1 / (2 h - 1): the sum of the squared weights of the values.
TEST(WeightMeans, HaveLessNoiseTheLongerTheHorizon) {
  constexpr int kNumValues = 1000;
  std::array<double, 3> variances = {};
  for (int age = 0; age < kNumValues; ++age) {
    WeightMeans means;
    means.Add(VectorXd::Zero(1));
    means.Add(VectorXd::Ones(1));
    for (int k = 0; k < age; ++k) means.Add(VectorXd::Zero(1));
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      variances[i] += std::pow(means.means()[i][0], 2);
    }
  }
  for (size_t i = 0; i < kHorizons.size(); ++i) {
    EXPECT_NEAR(variances[i], 1.0 / (2.0 * kHorizons[i] - 1.0), 1e-12);
  }
}

// --- Runs ---

// Targets with noise, which keep the weights moving.
Regression Noisy() {
  Regression problem;
  NumpyRandom random(7);
  problem.train.targets += random.Rand(2, 24);
  return problem;
}

// The weights after the last step, and those of the result.
struct Ends {
  double last = 0.0;
  double reported = 0.0;
};

Ends LossesAfter(long num_steps, const std::string& method) {
  const Regression problem = Noisy();
  TrainOptions options = Epochs(1000000, 3);
  options.initial_weights = problem.weights;
  options.shuffle = true;
  TrainingRun run(
      problem.model, {problem.train, problem.test}, method, options);
  EXPECT_EQ(run.error(), "");
  while (run.step() < num_steps && run.Step()) {
  }
  const auto loss = [&](const VectorXd& weights) {
    return MeanLoss(problem.model, weights, problem.train);
  };
  const double last = loss(run.weights());
  run.Stop();
  EXPECT_EQ(run.history().back().train_loss, loss(run.weights()));
  return {last, loss(run.weights())};
}

// All 24 samples choose, so that the run reports no higher loss than its last.
// (In a race the last weights may be those of another slice.)
TEST(WeightMeans, ARacedRunReportsTheLowestOfLastWeightsAndMeans) {
  int num_lower = 0;
  for (long num_steps = 1; num_steps < 12; ++num_steps) {
    const Ends ends = LossesAfter(num_steps, "adaptive");
    EXPECT_LE(ends.reported, ends.last) << num_steps;
    if (ends.reported < ends.last) ++num_lower;
  }
  EXPECT_GT(num_lower, 0);
}

TEST(WeightMeans, ARunWithoutARaceReportsItsLastWeights) {
  const Ends ends = LossesAfter(11, "adaptive:batch_size=3");
  EXPECT_EQ(ends.reported, ends.last);
}

// The next phase begins where the history says.
TEST(WeightMeans, TheNextPhaseBeginsWithTheReportedWeights) {
  const Regression problem = Noisy();
  TrainOptions options = Epochs(1000000, 3);
  options.initial_weights = problem.weights;
  options.shuffle = true;
  options.max_num_steps = 41;
  const TrainResult result =
      Train(problem.model,
            {problem.train, problem.test},
            "adaptive:steps=40>gradient_descent:step_size=1e-9:batch_size=3",
            options);
  EXPECT_EQ(result.error, "");
  const History& history = result.history;
  ASSERT_GT(history.size(), 2u);
  EXPECT_EQ(history[history.size() - 2].step, 40);
  // A step of 1e-9 changes the loss by less than 1e-8.
  EXPECT_NEAR(
      history.back().train_loss, history[history.size() - 2].train_loss, 1e-8);
}

}  // namespace weight_means_test
}  // namespace invgrad
