#include "problems/heat.h"

#include <cmath>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "problems/problems.h"
#include "tests/problems/heat_fields.h"
#include "tests/support/create_problem.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace heat_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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

// Below zero only what x lacks counts.
TEST(Heat, TheCutMetricIgnoresNegativeValues) {
  const LearningProblem problem =
      CreateLearningProblem("heat:num_samples=1:resolution=8:metric=x_l1_cut");
  const MatrixXd& truth = problem.train.solutions;
  ASSERT_GT(truth.maxCoeff(), 0.0);
  EXPECT_EQ(problem.metric->evaluate(truth, problem.train), 0.0);
  EXPECT_NEAR(problem.metric->evaluate(-3.0 * truth, problem.train),
              truth.mean(),
              1e-15);
  EXPECT_NEAR(problem.metric->evaluate(3.0 * truth, problem.train),
              2.0 * truth.mean(),
              1e-15);
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
        EXPECT_TRUE(problem.model->Forward(weights,
                                           problem.train,
                                           Network::Derivatives::kFirst,
                                           &forward,
                                           &error));
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

}  // namespace heat_test
}  // namespace invgrad
