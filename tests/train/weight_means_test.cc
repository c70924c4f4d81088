// Running means of the weights, and the runs that report them.

#include "invgrad/train/weight_means.h"

#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/parabola.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace weight_means_test {

using Eigen::VectorXd;

constexpr auto kHorizons = WeightMeans::kHorizons;

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
      // A mean forgets an error of rounding, of 1e-16 k, within h steps.
      EXPECT_NEAR(means.means()[i][1], expected, 1e-14 * (1.0 + k));
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

TEST(WeightMeans, AreRestoredIfTheyFit) {
  const auto archive_of = [](const VectorXd& means) {
    StateArchive archive;
    VectorXd none;
    VectorXd copy = means;
    archive.Visit("mean_0", &copy);
    archive.Visit("mean_1", &copy);
    archive.Visit("mean_2", means.size() == 4 ? &none : &copy);
    return archive;
  };
  const auto error_of = [&](const VectorXd& values) {
    const TemporaryFolder folder;
    std::string error;
    EXPECT_TRUE(archive_of(values).Write(folder / "state", {}, &error))
        << error;
    StateArchive archive = StateArchive::Read(folder / "state", {});
    WeightMeans means;
    means.VisitState("", 2, &archive);
    if (archive.error().empty()) {
      EXPECT_EQ(means.has_means(), values.size() > 0);
      for (const VectorXd& mean : means.means()) EXPECT_EQ(mean, values);
    }
    return archive.error();
  };
  EXPECT_EQ(error_of(VectorXd()), "");
  EXPECT_EQ(error_of(Eigen::Vector2d(1.0, 2.0)), "");
  EXPECT_NE(error_of(VectorXd::Ones(3)), "");
  EXPECT_NE(error_of(VectorXd::Ones(4)), "");
  EXPECT_NE(error_of(Eigen::Vector2d(1.0, NAN)), "");
}

// --- Runs ---

// Targets with noise, which keep the weights moving.
Regression Noisy() {
  Regression problem;
  NumpyRandom random(7);
  problem.train.targets += random.Rand(2, 24);
  return problem;
}

TrainOptions Options(const Regression& problem, long num_steps) {
  TrainOptions options = Epochs(1000000, 3);
  options.initial_weights = problem.weights;
  options.shuffle = true;
  options.max_num_steps = num_steps;
  return options;
}

TrainResult TrainNoisy(const std::string& method, const TrainOptions& options) {
  const Regression problem = Noisy();
  TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_EQ(result.error, "");
  return result;
}

// The weights after each step, up to those of the last one. In a race they may
// be those of a slice that loses; the first race begins after twelve steps. A
// run reports those of an earlier evaluation if they are better; the first one
// after the start is that of the first epoch, at step eight.
constexpr long kNumStepsWithoutRace = 12;

std::vector<VectorXd> WeightsAfter(long num_steps, const std::string& method) {
  const Regression problem = Noisy();
  TrainingRun run(problem.model,
                  {problem.train, problem.test},
                  method,
                  Options(problem, num_steps));
  std::vector<VectorXd> weights;
  for (long k = 0; k < num_steps; ++k) {
    EXPECT_TRUE(run.Step());
    weights.push_back(run.weights());
  }
  return weights;
}

TEST(WeightMeans, ARacedRunReportsTheLowestOfLastWeightsAndMeans) {
  const Regression problem = Noisy();
  std::set<int> reported;  // 0: the last weights
  for (long num_steps = 1; num_steps <= kNumStepsWithoutRace; ++num_steps) {
    const std::vector<VectorXd> steps = WeightsAfter(num_steps, "adaptive");
    WeightMeans means;
    for (const VectorXd& weights : steps) means.Add(weights);
    std::vector<VectorXd> candidates = {steps.back()};
    candidates.insert(
        candidates.end(), means.means().begin(), means.means().end());
    int lowest = 0;
    double loss = INFINITY;
    for (int i = 0; i < 4; ++i) {
      const double of_candidate =
          MeanLoss(problem.model, candidates[i], problem.train);
      if (of_candidate >= loss) continue;
      lowest = i;
      loss = of_candidate;
    }
    const TrainResult result =
        TrainNoisy("adaptive", Options(problem, num_steps));
    EXPECT_EQ(result.weights, candidates[lowest]) << num_steps;
    EXPECT_EQ(result.history.back().train_loss, loss) << num_steps;
    reported.insert(lowest);
  }
  EXPECT_GT(reported.size(), 1u);
}

TEST(WeightMeans, ARunWithoutARaceReportsItsLastWeights) {
  const std::string method = "adaptive:batch_size=3";
  const TrainResult result = TrainNoisy(method, Options(Noisy(), 11));
  EXPECT_EQ(result.weights, WeightsAfter(11, method).back());
}

// The means are a part of the state, in races and between them.
TEST(WeightMeans, AResumedRunReportsTheSame) {
  int num_means = 0;
  for (const long num_steps : {1L, 2L, 4L, 6L, 8L, 10L, 11L, 12L, 150L, 200L}) {
    const TrainOptions whole = Options(Noisy(), num_steps);
    const TrainResult expected = TrainNoisy("adaptive", whole);
    if (num_steps <= kNumStepsWithoutRace &&
        expected.weights != WeightsAfter(num_steps, "adaptive").back()) {
      ++num_means;
    }
    for (long stop = 1; stop < num_steps; stop += 1 + num_steps / 5) {
      SCOPED_TRACE(stop);
      const TemporaryFolder folder;
      TrainOptions part = whole;
      part.checkpoint_path = folder / "checkpoint";
      part.max_num_steps = stop;
      TrainNoisy("adaptive", part);
      part.max_num_steps = num_steps;
      ExpectSameRun(TrainNoisy("adaptive", part), expected);
    }
  }
  EXPECT_GT(num_means, 0);
}

TEST(WeightMeans, TheNextPhaseBeginsWithTheReportedWeights) {
  const Regression problem = Noisy();
  const std::string last = "gradient_descent:step_size=1e-2:batch_size=3";
  bool begins_with_a_mean = false;
  for (long num_steps = 1; num_steps <= kNumStepsWithoutRace; ++num_steps) {
    const TrainResult first =
        TrainNoisy("adaptive", Options(problem, num_steps));
    begins_with_a_mean |=
        first.weights != WeightsAfter(num_steps, "adaptive").back();
    TrainOptions options = Options(problem, 4);
    options.initial_weights = first.weights;
    const TrainResult second = TrainNoisy(last, options);
    const TrainResult phases =
        TrainNoisy(fmt::format("adaptive:steps={}>{}", num_steps, last),
                   Options(problem, num_steps + 4));
    EXPECT_EQ(phases.weights, second.weights) << num_steps;
  }
  EXPECT_TRUE(begins_with_a_mean);
}

// A gradient step, which fails after nine steps.
class ForNineSteps final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    *error = "no step";
    *step = -0.1 * at_x.gradient;
    return ++num_steps_ <= 9;
  }

 private:
  int num_steps_ = 0;
};

TEST(WeightMeans, TheWeightsOfARunThatFailsHaveTheLossOfItsHistory) {
  RegisterRule<ForNineSteps>("for_nine_steps", "step = -gradient / 10");
  const Regression problem = Noisy();
  const TrainResult result =
      TrainNoisy("for_nine_steps:batch_size=auto", Options(problem, 100));
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(MeanLoss(problem.model, result.weights, problem.train),
            result.history.back().train_loss)
      << result.summary.message;
}

}  // namespace weight_means_test
}  // namespace invgrad
