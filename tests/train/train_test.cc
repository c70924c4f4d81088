#include "invgrad/train.h"

#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "tests/support/function_rule.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace train_test {

TEST(Trainer, OneFullBatchStepOfGradientDescentIsTheGradient) {
  const Regression problem;
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_start;
  std::string error;
  ASSERT_TRUE(problem.model.Linearize(
      problem.weights, problem.train, parts, &at_start, &error));
  const auto rule = MakeRule("gradient_descent:step_size=0.1");
  TrainOptions options = Epochs(1, 0);
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.num_steps, 1);
  EXPECT_LT(
      (result.weights - (problem.weights - 0.1 * at_start.gradient)).norm(),
      1e-15);
  ASSERT_EQ(result.history.size(), 2u);
  EXPECT_EQ(result.history[1].batch_loss, at_start.cost);
  EXPECT_EQ(result.history[0].train_loss, at_start.cost);
  EXPECT_EQ(result.history[1].train_loss,
            MeanLoss(problem.model, result.weights, problem.train));
}

TEST(Trainer, OptionsOutOfRangeAreNamed) {
  const Regression problem;
  TrainOptions options;
  options.max_time_in_seconds = std::nan("");
  EXPECT_EQ(Refusal(problem, options, "adam"),
            "max_time_in_seconds = nan; allowed: 0 and above");
  options = TrainOptions();
  options.max_num_epochs = -1;
  EXPECT_EQ(Refusal(problem, options, "adam"),
            "max_num_epochs = -1; allowed: 0 and above");
  options = TrainOptions();
  options.patience = -1;
  EXPECT_EQ(Refusal(problem, options, "adam"),
            "patience = -1; allowed: 0 and above");
}

TEST(Trainer, AnUnknownOptionIsNamedOnce) {
  const std::string error = Refusal(Regression(), TrainOptions(), "adam:x=1");
  EXPECT_EQ(error.find("adam: "), error.rfind("adam: ")) << error;
}

TEST(Trainer, SameInputsGiveTheSameBits) {
  const Regression problem;
  TrainOptions options = Epochs(5, 4);
  options.shuffle = true;
  options.seed = 7;
  const auto first = MakeRule("half_inverse");
  const auto second = MakeRule("half_inverse");
  const TrainResult a = TrainRegression(problem, options, first.get());
  const TrainResult b = TrainRegression(problem, options, second.get());
  EXPECT_EQ(a.weights, b.weights);
  options.seed = 8;
  const auto third = MakeRule("half_inverse");
  EXPECT_NE(TrainRegression(problem, options, third.get()).weights, a.weights);
}

TEST(Trainer, LossIsPerSampleWhateverTheReduction) {
  const Regression mean(Reduction::kMean);
  const Regression sum(Reduction::kSum);
  const double loss = MeanLoss(mean.model, mean.weights, mean.train);
  EXPECT_NEAR(MeanLoss(sum.model, sum.weights, sum.train), loss, 1e-15);
  // The mean over all samples is that over two halves.
  EXPECT_NEAR(
      0.5 * (MeanLoss(mean.model, mean.weights, mean.train.Range(0, 12)) +
             MeanLoss(mean.model, mean.weights, mean.train.Range(12, 12))),
      loss,
      1e-15);
}

TEST(Trainer, SamplesThatDoNotFillABatchAreLeftOut) {
  const Regression problem;  // 24 samples
  const auto rule = MakeRule("adam");
  const TrainResult result = TrainRegression(problem, Epochs(3, 7), rule.get());
  EXPECT_EQ(result.summary.num_steps, 3 * 3);
}

TEST(Trainer, NoBudgetIsNoStep) {
  const Regression problem;
  const auto rule = MakeRule("adam");
  TrainOptions options = Epochs(0, 8);
  EXPECT_EQ(TrainRegression(problem, options, rule.get()).weights,
            problem.weights);
  options = TrainOptions();
  options.max_num_steps = 0;
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.num_steps, 0);
  EXPECT_EQ(result.history.size(), 1u);
}

TEST(Trainer, OneSampleIsAWholeEpoch) {
  Regression problem;
  problem.train = problem.train.Range(0, 1);
  problem.test = problem.test.Range(0, 0);
  const auto rule = MakeRule("half_inverse:step_size=auto");
  const TrainResult result = TrainRegression(problem, Epochs(4, 1), rule.get());
  EXPECT_EQ(result.summary.num_steps, 4);
  EXPECT_LT(result.history.back().train_loss,
            result.history.front().train_loss);
  EXPECT_TRUE(std::isnan(result.history.back().test_loss));
}

TEST(Trainer, RefusesDataThatAreNotFinite) {
  Regression problem;
  problem.train.inputs(1, 5) = NAN;
  const std::string error = Refusal(problem, Epochs(1, 8), "adam");
  EXPECT_NE(error.find("train data"), std::string::npos) << error;
  EXPECT_NE(error.find('5'), std::string::npos) << error;
}

TEST(Trainer, StopsAtTheTargetLossAndWhenPatienceEnds) {
  const Regression problem;
  TrainOptions options = Epochs(10000, 8);
  options.target_loss = 1e-3;
  auto rule = MakeRule("half_inverse:step_size=auto");
  TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_LE(result.history.back().train_loss, 1e-3);

  options.target_loss = 0.0;
  options.patience = 3;
  // Steps too small to change a weight: there is never a new minimum.
  rule = MakeRule("gradient_descent:step_size=1e-300");
  result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 3 * 3);
}

TEST(Trainer, TimeBudgetEndsTheRun) {
  const Regression problem;
  TrainOptions options;
  options.max_time_in_seconds = 0.02;
  options.batch_size = 8;
  const auto rule = MakeRule("adam");
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.message, "time used up");
  EXPECT_GE(result.summary.train_time_in_seconds, 0.02);
  EXPECT_GT(result.summary.num_steps, 0);
}

// A step that waits takes no time of the processor.
TEST(Trainer, TimeOfTheProcessorLeavesWaitingOut) {
  const Regression problem;
  FunctionRule rule([](const Linearization& at_x,
                       Eigen::VectorXd* step,
                       std::string* /*error*/) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    *step = Eigen::VectorXd::Zero(at_x.gradient.size());
    return true;
  });
  TrainOptions options = Epochs(1, 0);
  EXPECT_GE(
      TrainRegression(problem, options, &rule).summary.train_time_in_seconds,
      0.1);
  options.cpu_time = true;
  const double seconds =
      TrainRegression(problem, options, &rule).summary.train_time_in_seconds;
  EXPECT_GT(seconds, 0.0);
  EXPECT_LT(seconds, 0.05);
}

TEST(Trainer, EvaluationsAreDenseFirstAndLogarithmicLater) {
  for (int epoch = 1; epoch <= 40; ++epoch) {
    EXPECT_TRUE(IsEvaluationEpoch(epoch)) << epoch;
  }
  int last = 40;
  for (int epoch = 41; epoch <= 100000; ++epoch) {
    if (!IsEvaluationEpoch(epoch)) continue;
    const double growth = static_cast<double>(epoch - last) / last;
    EXPECT_LE(growth, 1.0 / 20.0 + 1e-12) << epoch;
    EXPECT_GE(growth, 1.0 / 42.0) << epoch;
    last = epoch;
  }
}

TEST(Trainer, CallbacksEndTheRunAsInCeres) {
  const Regression problem;
  for (const auto& [verdict, type] :
       {std::make_pair(ceres::SOLVER_ABORT, ceres::USER_FAILURE),
        std::make_pair(ceres::SOLVER_TERMINATE_SUCCESSFULLY,
                       ceres::USER_SUCCESS)}) {
    StopAt callback(4, verdict);
    TrainOptions options = Epochs(10, 8);
    options.callbacks.push_back(&callback);
    const auto rule = MakeRule("adam");
    const TrainResult result = TrainRegression(problem, options, rule.get());
    EXPECT_EQ(result.summary.termination_type, type);
    EXPECT_EQ(callback.steps, std::vector<int>({0, 1, 2, 3, 4}));
    EXPECT_EQ(result.summary.num_steps, 4);
    EXPECT_EQ(result.history.back().step, 4);
  }
}

// Those that fill no batch.
TEST(Trainer, SaysWhichSamplesAreInNoStep) {
  const Regression problem;
  const auto message = [&](int batch_size, bool shuffle) {
    TrainOptions options = Epochs(2, batch_size);
    options.shuffle = shuffle;
    return Train(problem.model, problem.train, "adam", options).summary.message;
  };
  EXPECT_EQ(message(5, false),
            "epochs done; the last 4 of 24 samples are in no step");
  EXPECT_EQ(message(5, true), "epochs done");
  EXPECT_EQ(message(6, false), "epochs done");
  EXPECT_EQ(message(0, false), "epochs done");
}

}  // namespace train_test
}  // namespace invgrad
