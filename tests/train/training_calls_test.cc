// What the history counts as the calls of the simulator.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace training_calls_test {

// The column `simulator_calls` of a run on 24 samples, |x| = |y| = 2.
std::vector<double> Calls(const std::string& method, TrainOptions options) {
  const Regression problem;
  options.initial_weights = problem.weights;
  const TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_EQ(result.error, "");
  std::vector<double> calls;
  for (const HistoryRow& row : result.history) {
    calls.push_back(row.simulator_calls);
  }
  return calls;
}

// A value and a product J^T w a sample; losses are evaluated without a count.
TEST(TrainingCalls, AGradientIsTwoASample) {
  EXPECT_EQ(Calls("gradient_descent:step_size=0.1", Epochs(3, 8)),
            (std::vector<double>{0, 2 * 24, 4 * 24, 6 * 24}));
}

// A value and the two products of its Jacobian.
TEST(TrainingCalls, AJacobianIsThreeASample) {
  EXPECT_EQ(Calls("half_inverse", Epochs(2, 8)),
            (std::vector<double>{0, 3 * 24, 6 * 24}));
}

TEST(TrainingCalls, OnlySamplesOfBatchesCount) {
  // Two batches of ten, and four samples are left out.
  EXPECT_EQ(Calls("gradient_descent:step_size=0.1", Epochs(1, 10)),
            (std::vector<double>{0, 2 * 20}));
}

TEST(TrainingCalls, ThreadsDoNotMatter) {
  TrainOptions options = Epochs(3, 8);
  const std::vector<double> one = Calls("half_inverse", options);
  options.num_threads = 3;
  EXPECT_EQ(Calls("half_inverse", options), one);
}

// A rejected step of Ceres counts its evaluation: from the second row on, at
// least one value a sample for each step.
TEST(TrainingCalls, OfCeresAreThoseOfItsEvaluations) {
  const std::vector<double> calls = Calls("ceres_lm", Epochs(4));
  ASSERT_GE(calls.size(), 3u);
  EXPECT_EQ(calls[0], 0);
  for (size_t k = 1; k < calls.size(); ++k) {
    EXPECT_GE(calls[k], calls[k - 1] + 24);
    EXPECT_EQ(std::fmod(calls[k], 24.0), 0.0);
  }
}

TEST(TrainingCalls, PhasesAddUp) {
  EXPECT_EQ(Calls("gradient_descent:step_size=0.1:epochs=1>half_inverse",
                  Epochs(2, 8))
                .back(),
            2 * 24 + 3 * 24);
}

TEST(TrainingCalls, AResumedRunGoesOnCounting) {
  const TemporaryFolder folder;
  const std::vector<double> whole = Calls("half_inverse", Epochs(6, 8));
  TrainOptions options = Epochs(3, 8);
  options.checkpoint_path = folder / "checkpoint";
  Calls("half_inverse", options);
  options.max_num_epochs = 6;
  EXPECT_EQ(Calls("half_inverse", options), whole);
}

}  // namespace training_calls_test
}  // namespace invgrad
