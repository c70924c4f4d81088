// Methods in phases: how they end, go on, and are refused.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/train.h"
#include "tests/support/parse_method.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/parabola.h"

namespace invgrad {
namespace phases_resume_test {

TEST(Phases, WhatEndsARunEndsItInAnyPhase) {
  const std::string method = "adam:batch_size=4:epochs=2>adam:batch_size=4";
  StopAt early(4);
  TrainOptions options = Epochs(5);
  options.callbacks = {&early};
  TrainResult result = TrainBy(method, options);
  EXPECT_EQ(result.summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(result.summary.num_steps, 4);
  EXPECT_EQ(result.summary.message, "phase 1: stopped by a callback at step 4");

  StopAt late(8);
  options.callbacks = {&late};
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.num_steps, 8);
  EXPECT_EQ(result.summary.message, "phase 2: stopped by a callback at step 2");

  options = Epochs(5);
  options.target_loss = 1e6;
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 0);

  result = TrainBy("gradient_descent:step_size=1e200:epochs=2>adam", Epochs(5));
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(result.summary.message.rfind("phase 1: diverged", 0), 0u)
      << result.summary.message;
  // The second phase diverges as a run of its own: at its own step.
  const std::string diverging = "gradient_descent:step_size=1e200";
  const std::string alone = TrainBy(diverging, Epochs(5)).summary.message;
  result = TrainBy("adam:batch_size=4:epochs=2>" + diverging, Epochs(5));
  EXPECT_EQ(result.summary.message, "phase 2: " + alone);
  EXPECT_EQ(alone.rfind("diverged at step ", 0), 0u) << alone;

  // No step of any size is a new minimum.
  options = Epochs(50);
  options.patience = 2;
  result = TrainBy(
      "gradient_descent:step_size=1e-300:epochs=20>gradient_descent", options);
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 2);
}

TEST(Phases, ARunThatIsStoppedGoesOnBitForBit) {
  const Parabola problem;
  const std::string method =
      "adam:step_size=1e-2:batch_size=4:epochs=3>sip:batch_size=3:steps=5>"
      "rmsprop:batch_size=5";
  TrainOptions options = Epochs(8);
  options.shuffle = true;
  const TrainResult whole = TrainBy(method, options, problem, problem.weights);

  const TemporaryFolder folder;
  options.checkpoint_path = folder / "checkpoint";
  const auto stop_at = [&](int step) {
    StopAt watcher(step);
    TrainOptions stopped = options;
    stopped.callbacks = {&watcher};
    return TrainBy(method, stopped, problem, problem.weights);
  };
  // 9 steps, then 5, then 2 an epoch: within each, at an end, by budgets.
  for (const int step : {4, 9, 11, 14, 17}) {
    SCOPED_TRACE(step);
    EXPECT_EQ(stop_at(step).summary.num_steps, step);
  }
  EXPECT_TRUE(std::filesystem::exists(options.checkpoint_path));
  ExpectSameRun(TrainBy(method, options, problem, problem.weights), whole);

  // A larger budget in epochs goes on too.
  std::filesystem::remove(options.checkpoint_path);
  for (const int num_epochs : {2, 4, 8}) {
    options.max_num_epochs = num_epochs;
    const TrainResult result =
        TrainBy(method, options, problem, problem.weights);
    ASSERT_EQ(result.error, "");
    if (num_epochs == 8) ExpectSameRun(result, whole);
  }
}

TEST(Phases, BadInputOfAnyPhaseIsRefusedBeforeAnythingRuns) {
  const auto expect = [](const std::string& method,
                         const std::vector<std::string>& words) {
    SCOPED_TRACE(method);
    // With neurons of more weights than a rule can propose.
    const Parabola problem(3000);
    StopAt watcher;
    TrainOptions options = Epochs(5);
    options.callbacks = {&watcher};
    const TrainResult result =
        TrainBy(method, options, problem, problem.weights);
    EXPECT_NE(result.error, "");
    for (const std::string& word : words) {
      EXPECT_NE(result.error.find(word), std::string::npos) << result.error;
    }
    EXPECT_EQ(result.weights, problem.weights);
    EXPECT_TRUE(result.history.empty());
    EXPECT_TRUE(watcher.steps.empty());
  };
  expect("adam:epochs=1>supervised", {"supervised: ", "no solutions"});
  expect("adam:epochs=1>adam:batch_size=13", {"batch_size=13", "12 training"});
  expect("adam:epochs=1:batch_size=13>adam", {"batch_size=13", "12 training"});
  expect("adam:epochs=1>ceres_lm+adam", {"ceres_lm+adam: ", "block"});
}

TEST(Phases, ACheckpointOfAnotherNetworkIsRefused) {
  const TemporaryFolder folder;
  TrainOptions options = Epochs(3);
  options.checkpoint_path = folder / "checkpoint";
  const std::string method = "adam:epochs=1>adam";
  const Parabola small;
  ASSERT_EQ(TrainBy(method, options, small, small.weights).error, "");
  const Parabola large(5);
  const TrainResult result = TrainBy(method, options, large, large.weights);
  EXPECT_NE(result.error, "");
  EXPECT_NE(result.error.find("checkpoint: it is of another run: network"),
            std::string::npos)
      << result.error;
  EXPECT_EQ(result.weights, large.weights);
}

TEST(Phases, APointHasNone) {
  PointObjective objective(std::make_shared<IdentitySimulator>(1),
                           std::make_shared<SquaredNormLoss>(1, 1.0),
                           Eigen::VectorXd::Zero(1),
                           Eigen::VectorXd::Ones(1));
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  EXPECT_FALSE(MinimizeByMethod(ParseMethod("adam:steps=1>newton"),
                                MinimizerOptions(),
                                nullptr,
                                &objective,
                                &path,
                                &summary,
                                &error));
  EXPECT_NE(error.find("phases"), std::string::npos) << error;
}

}  // namespace phases_resume_test
}  // namespace invgrad
