// Training runs with TrainOptions::averages_weights.

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/parabola.h"
#include "tests/train/sum_of_weights.h"

namespace invgrad {
namespace averaged_training_test {

using Eigen::VectorXd;

// y = w a + b to be fitted to a line, from 48 samples with or without noise.
struct Line {
  Model model;
  DataSet train;
  DataSet test;

  explicit Line(double noise)
      : model(DenseNetwork({1, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::make_shared<SquaredNormLoss>(1, 1.0),
              Reduction::kMean) {
    constexpr int kNumSamples = 48;
    NumpyRandom random(4);
    train.inputs = random.Rand(1, kNumSamples);
    train.contexts.resize(0, kNumSamples);
    train.solutions.resize(0, kNumSamples);
    train.targets = 2.0 * train.inputs.array() - 0.5 +
                    noise * (random.Rand(1, kNumSamples).array() - 0.5);
    test = train.Range(0, 8);
  }
};

TrainOptions Averaging(TrainOptions options) {
  options.averages_weights = true;
  options.initial_weights = Eigen::Vector2d(0.5, 0.25);
  return options;
}

struct RecordedRun {
  TrainResult result;
  std::vector<VectorXd> weights;  // after each step
};

template <typename Method>
RecordedRun RunBy(const Method& method,
                  const Line& line,
                  TrainOptions options) {
  TrainingRun run(line.model, {line.train, line.test}, method, options);
  EXPECT_EQ(run.error(), "");
  RecordedRun all;
  while (run.Step()) all.weights.push_back(run.weights());
  all.result = run.result();
  return all;
}

void ExpectAverage(const VectorXd& average, const std::vector<VectorXd>& all) {
  const VectorXd sum = SumOfWeights(all);
  EXPECT_LE((average - sum).norm(), 1e-14 * sum.norm());
}

constexpr char kNoisyDescent[] = "gradient_descent:step_size=0.3";
const std::string kAverageIsFinal = "; final: averaged weights (train loss ";
const std::string kLastAreFinal = "; final: last weights (train loss ";

TEST(AveragedTraining, EndsWithTheAverageWhereStepsAreNoisy) {
  Line line(1.0);
  const TrainOptions options = Averaging(Epochs(20, 1));
  const VectorXd last = RunBy(kNoisyDescent, line, options).weights.back();
  std::string error;
  // Test data that the last weights fit, and the average does not.
  line.test = line.train.Range(0, 1);
  ASSERT_TRUE(line.model.Predict(last, line.test, &line.test.targets, &error))
      << error;
  const RecordedRun run = RunBy(kNoisyDescent, line, options);
  const TrainResult& result = run.result;
  EXPECT_EQ(run.weights.back(), last);
  ExpectAverage(result.weights, run.weights);
  ASSERT_EQ(result.history.size(), 22u);
  const HistoryRow& before = result.history[20];
  const HistoryRow& final = result.history[21];
  EXPECT_EQ(before.step, final.step);
  EXPECT_EQ(before.train_loss, MeanLoss(line.model, last, line.train));
  EXPECT_EQ(before.test_loss, 0.0);
  EXPECT_EQ(final.train_loss, MeanLoss(line.model, result.weights, line.train));
  EXPECT_EQ(final.test_loss, MeanLoss(line.model, result.weights, line.test));
  EXPECT_EQ(before.average_train_loss, final.train_loss);
  EXPECT_EQ(before.average_test_loss, final.test_loss);
  EXPECT_LT(final.train_loss, before.train_loss);
  EXPECT_GT(final.test_loss, 0.0);
  EXPECT_EQ(result.summary.message.rfind("epochs done" + kAverageIsFinal, 0),
            0u)
      << result.summary.message;
}

TEST(AveragedTraining, EndsWithTheLastWeightsWhereTheyConverge) {
  const Line line(0.0);
  TrainOptions options = Averaging(Epochs(20, 0));
  const RecordedRun run = RunBy(kNoisyDescent, line, options);
  const HistoryRow& last = run.result.history.back();
  EXPECT_EQ(run.result.weights, run.weights.back());
  EXPECT_EQ(run.result.history.size(), 21u);
  EXPECT_LT(last.train_loss, last.average_train_loss);
  // Rounding errors of the average and of the sum.
  EXPECT_NEAR(last.average_train_loss,
              MeanLoss(line.model, SumOfWeights(run.weights), line.train),
              1e-13);
  EXPECT_EQ(run.result.summary.message.rfind("epochs done" + kLastAreFinal, 0),
            0u)
      << run.result.summary.message;
}

TEST(AveragedTraining, TakesTheSameSteps) {
  const Line line(1.0);
  for (const std::string method :
       {"adam",
        "half_inverse:step_size=auto",
        "levenberg_marquardt:step_size=auto:control=gain"}) {
    SCOPED_TRACE(method);
    TrainOptions options = Averaging(Epochs(4, 8));
    options.shuffle = true;
    const RecordedRun with = RunBy(method, line, options);
    options.averages_weights = false;
    const RecordedRun without = RunBy(method, line, options);
    EXPECT_EQ(with.weights, without.weights);
    const std::string& message = without.result.summary.message;
    EXPECT_EQ(with.result.summary.message.rfind(message, 0), 0u);
    const History& history = without.result.history;
    for (size_t i = 0; i < history.size(); ++i) {
      ExpectSameRow(with.result.history[i], history[i]);
      EXPECT_TRUE(std::isnan(history[i].average_train_loss));
    }
    EXPECT_TRUE(std::isnan(with.result.history[0].average_train_loss));
    EXPECT_TRUE(std::isfinite(with.result.history[1].average_train_loss));
  }
}

// The last weights, not the average that the result has, are those that a run
// goes on from.
TEST(AveragedTraining, AStoppedRunGoesOnBitForBit) {
  const Line line(1.0);
  const std::string method =
      "adam:step_size=0.3:batch_size=4:epochs=2>"
      "gradient_descent:step_size=0.3:batch_size=1";
  TrainOptions options = Averaging(Epochs(4));
  options.shuffle = true;
  const TrainResult whole = RunBy(method, line, options).result;
  EXPECT_NE(whole.summary.message.find(kAverageIsFinal), std::string::npos);
  const TemporaryFolder folder;
  options.checkpoint_path = folder / "checkpoint";
  // In 2 epochs of 12 steps, and in the following ones.
  for (const int step : {5, 12, 24, 25, 60}) {
    StopAt callback(step);
    TrainOptions stopped = options;
    stopped.callbacks = {&callback};
    const TrainResult part = RunBy(method, line, stopped).result;
    EXPECT_EQ(part.summary.num_steps, step);
  }
  const TrainResult resumed = RunBy(method, line, options).result;
  ExpectSameRun(resumed, whole);
  EXPECT_EQ(resumed.summary.message, whole.summary.message);
  for (size_t i = 0; i < whole.history.size(); ++i) {
    EXPECT_TRUE(IsSame(resumed.history[i].average_train_loss,
                       whole.history[i].average_train_loss));
  }
}

TEST(AveragedTraining, EveryPhaseHasItsOwnAverage) {
  const Line line(1.0);
  const std::string method = kNoisyDescent;
  const RecordedRun run =
      RunBy(method + ":epochs=3>" + method, line, Averaging(Epochs(8, 1)));
  EXPECT_NE(run.result.summary.message.find(kAverageIsFinal),
            std::string::npos);
  constexpr int kStepsOfFirst = 3 * 48;
  ExpectAverage(run.result.weights,
                {run.weights.begin() + kStepsOfFirst, run.weights.end()});
}

TEST(AveragedTraining, MinimizersOfCeresHaveNoAverage) {
  const Line line(1.0);
  const TrainOptions options = Averaging(Epochs(4));
  const TrainResult refused =
      Train(line.model, line.train, "ceres_lm", options);
  EXPECT_EQ(refused.error.rfind("averages_weights: ", 0), 0u) << refused.error;
  EXPECT_TRUE(refused.history.empty());
  const RecordedRun run = RunBy("adam:epochs=2>ceres_lm", line, options);
  const History& history = run.result.history;
  EXPECT_EQ(run.result.weights, run.weights.back());
  EXPECT_TRUE(std::isfinite(history[2].average_train_loss));
  EXPECT_TRUE(std::isnan(history.back().average_train_loss));
  EXPECT_EQ(run.result.summary.message.find("final"), std::string::npos);
}

// Gradient descent whose step `jump_at` is `value` in all weights. It keeps
// what it judges, so that the run takes a step back that leaves no finite loss.
class JumpingRule final : public UpdateRule {
 public:
  JumpingRule(int jump_at, double value, bool judges)
      : jump_at_(jump_at), value_(value), judges_(judges) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* /*error*/) override {
    *step = -0.3 * at_x.gradient;
    if (++num_steps_ == jump_at_) step->setConstant(value_);
    return true;
  }
  bool JudgesSteps() const override { return judges_; }
  bool KeepsStep(double /*cost*/, double /*fraction*/) override { return true; }

 private:
  const int jump_at_;
  const double value_;
  const bool judges_;
  int num_steps_ = 0;
};

std::shared_ptr<UpdateRule> JumpAt(int step, double value, bool judges) {
  return std::make_shared<JumpingRule>(step, value, judges);
}

TEST(AveragedTraining, ADivergedRunEndsWithItsLastGoodWeights) {
  const Line line(1.0);
  for (const double value : {std::nan(""), HUGE_VAL, 1e200}) {
    // Within an epoch, at the end of one, and in the last step.
    for (const int step : {100, 96, 48 * 6}) {
      TrainOptions options = Averaging(Epochs(6, 1));
      const TrainResult with =
          RunBy(JumpAt(step, value, false), line, options).result;
      options.averages_weights = false;
      const TrainResult without =
          RunBy(JumpAt(step, value, false), line, options).result;
      EXPECT_EQ(with.summary.termination_type, ceres::FAILURE);
      EXPECT_EQ(with.summary.message, without.summary.message);
      EXPECT_EQ(with.weights, without.weights);
      EXPECT_EQ(with.history.size(), without.history.size());
      for (const HistoryRow& row : with.history) {
        EXPECT_EQ(std::isfinite(row.average_train_loss),
                  row.step > 0 && std::isfinite(row.train_loss));
      }
    }
  }
}

TEST(AveragedTraining, AStepTakenBackCountsAsTheWeightsThatItLeaves) {
  const Line line(1.0);
  // The next step takes it back, or an evaluation, or the last one.
  for (const int step : {100, 96, 48 * 6}) {
    for (const double value : {HUGE_VAL, 1e200}) {
      RecordedRun run =
          RunBy(JumpAt(step, value, true), line, Averaging(Epochs(6, 1)));
      EXPECT_EQ(run.result.summary.num_taken_back, 1);
      EXPECT_NE(run.result.summary.message.find(kAverageIsFinal),
                std::string::npos)
          << run.result.summary.message;
      run.weights[step - 1] = run.weights[step - 2];
      ExpectAverage(run.result.weights, run.weights);
    }
  }
}

}  // namespace averaged_training_test
}  // namespace invgrad
