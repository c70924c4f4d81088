// Runs that go on from their checkpoint, bit for bit.

#include <unistd.h>

#include <cstdio>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rules/rules.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace train_resume_test {

class EveryRuleResumes : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryRuleResumes, BitForBit) {
  const Regression problem;
  const std::string path = ::testing::TempDir() + "trainer_checkpoint_" +
                           GetParam() + std::to_string(::getpid());
  std::remove(path.c_str());
  TrainOptions options = Epochs(6, 8);
  options.shuffle = true;
  const auto whole_rule = MakeRule(GetParam());
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());

  options.checkpoint_path = path;
  options.checkpoint_interval_in_seconds = 0.0;
  options.max_num_epochs = 3;
  const auto first_rule = MakeRule(GetParam());
  TrainRegression(problem, options, first_rule.get());
  options.max_num_epochs = 6;
  const auto second_rule = MakeRule(GetParam());
  const TrainResult resumed =
      TrainRegression(problem, options, second_rule.get());
  std::remove(path.c_str());

  EXPECT_EQ(resumed.weights, whole.weights);
  EXPECT_EQ(resumed.summary.num_steps, whole.summary.num_steps);
  ASSERT_EQ(resumed.history.size(), whole.history.size());
  for (size_t i = 0; i < whole.history.size(); ++i) {
    EXPECT_EQ(resumed.history[i].step, whole.history[i].step);
    EXPECT_EQ(resumed.history[i].train_loss, whole.history[i].train_loss);
    EXPECT_EQ(resumed.history[i].test_loss, whole.history[i].test_loss);
  }
}

std::vector<std::string> RuleNames() {
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Trainer,
                         EveryRuleResumes,
                         ::testing::ValuesIn(RuleNames()),
                         [](const auto& info) { return info.param; });

TEST(Trainer, RefusesACheckpointOfAnotherRun) {
  const Regression problem;
  const std::string path =
      ::testing::TempDir() + "trainer_other_" + std::to_string(::getpid());
  StateArchive archive;
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(3);
  archive.Visit("weights", &weights);
  std::string error;
  ASSERT_TRUE(archive.Write(path, &error)) << error;
  TrainOptions options = Epochs(1, 8);
  options.checkpoint_path = path;
  error = Refusal(problem, options, "adam");
  EXPECT_NE(error.find(path), std::string::npos) << error;
  std::remove(path.c_str());
}

TEST(Trainer, RefusesACheckpointOfAnotherBatchSize) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainOptions options = Epochs(2, 8);
  options.checkpoint_path = folder / "checkpoint";
  const auto rule = MakeRule("adam");
  const TrainResult before = TrainRegression(problem, options, rule.get());
  options.batch_size = 6;
  const std::string error = Refusal(problem, options, "adam");
  EXPECT_NE(error.find("found batch_size=8, wanted 6"), std::string::npos)
      << error;
}

// The orders of the samples follow from the seed.
TEST(Trainer, RefusesACheckpointOfAnotherSeed) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainOptions options = Epochs(2, 8);
  options.shuffle = true;
  options.seed = 3;
  options.checkpoint_path = folder / "checkpoint";
  const auto rule = MakeRule("adam");
  TrainRegression(problem, options, rule.get());
  options.seed = 4;
  const std::string error = Refusal(problem, options, "adam");
  EXPECT_NE(error.find("found seed=3, wanted 4"), std::string::npos) << error;
}

// Full Gauss-Newton steps of almost twice the length on batches of four: some
// make their batch worse.
TEST(Trainer, ControlledRunsResumeBitForBit) {
  const Regression problem;
  const TemporaryFolder folder;
  const std::string text =
      "power:kappa=1:step_size=1.9:truncation=0:control=gain";
  TrainOptions options = Epochs(8, 4);
  options.shuffle = true;
  const auto whole_rule = MakeRule(text);
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());
  EXPECT_GT(whole.summary.num_taken_back, 2);
  EXPECT_LT(whole.summary.num_taken_back, 40);
  EXPECT_LT(whole.history.back().train_loss,
            0.1 * whole.history.front().train_loss);
  for (const int stop : {1, 7, 20, 33}) {
    SCOPED_TRACE(stop);
    TrainOptions stopped = options;
    stopped.checkpoint_path = folder / std::to_string(stop);
    stopped.max_num_steps = stop;
    const auto first = MakeRule(text);
    TrainRegression(problem, stopped, first.get());
    stopped.max_num_steps = options.max_num_steps;
    const auto second = MakeRule(text);
    const TrainResult resumed = TrainRegression(problem, stopped, second.get());
    EXPECT_EQ(resumed.weights, whole.weights);
    EXPECT_EQ(resumed.summary.num_taken_back, whole.summary.num_taken_back);
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
  }
}

// Stopped within an epoch of three steps (4, 5), at its end, where an
// evaluation is due (6), and before the first step (0).
TEST(Trainer, AStoppedRunGoesOnWhereItWas) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainOptions options = Epochs(5, 8);
  options.shuffle = true;
  const auto whole_rule = MakeRule("adam");
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());
  for (const int step : {0, 4, 5, 6}) {
    SCOPED_TRACE(step);
    StopAt callback(step);
    TrainOptions stopped_options = options;
    stopped_options.checkpoint_path = folder / std::to_string(step);
    stopped_options.callbacks.push_back(&callback);
    const auto first_rule = MakeRule("adam");
    const TrainResult stopped =
        TrainRegression(problem, stopped_options, first_rule.get());
    EXPECT_EQ(stopped.summary.num_steps, step);
    stopped_options.callbacks.clear();
    const auto second_rule = MakeRule("adam");
    const TrainResult resumed =
        TrainRegression(problem, stopped_options, second_rule.get());
    EXPECT_EQ(resumed.weights, whole.weights);
    EXPECT_EQ(resumed.summary.num_steps, whole.summary.num_steps);
    ASSERT_EQ(resumed.history.size(), whole.history.size());
    for (size_t i = 0; i < whole.history.size(); ++i) {
      EXPECT_EQ(resumed.history[i].step, whole.history[i].step);
      EXPECT_EQ(resumed.history[i].train_loss, whole.history[i].train_loss);
    }
  }
}

}  // namespace train_resume_test
}  // namespace invgrad
