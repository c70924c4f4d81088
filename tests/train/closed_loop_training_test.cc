// Training a network that acts at every step of the simulator, by each pull-back
// through loss and simulator.
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/create_problem.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace closed_loop_training_test {

constexpr int kBatchSize = 16;
constexpr long kNumSteps = 24;

TrainResult Train(const std::string& problem, const std::string& method) {
  TrainOptions options;
  options.batch_size = kBatchSize;
  options.max_num_steps = kNumSteps;
  return TrainProblem(CreateLearningProblem(problem), method, options);
}

// What a method is expected to do beyond staying finite.
struct Case {
  const char* method;
  bool inverts;     // the simulator, sample by sample
  bool loss_falls;  // its steps are so small that the loss must fall
};

constexpr Case kCases[] = {
    {"sip", true, true},
    {"newton/numerical/adam:accept_nearer=true", true, true},
    {"hig", false, false},
    {"half_inverse", false, false},
    {"dp_adam", false, true},
    {"gradient/adjoint/half_inverse", false, false},
};

class ClosedLoopTraining
    : public testing::TestWithParam<std::tuple<const char*, Case>> {};

TEST_P(ClosedLoopTraining, IsFiniteAndCountsEverySample) {
  const auto& [problem, method] = GetParam();
  SCOPED_TRACE(std::string(problem) + ", " + method.method);
  const TrainResult run = Train(problem, method.method);
  ASSERT_NE(run.summary.termination_type, ceres::FAILURE)
      << run.summary.message;
  EXPECT_EQ(run.summary.num_steps, kNumSteps) << run.summary.message;
  EXPECT_TRUE(run.weights.allFinite());
  for (const HistoryRow& row : run.history) {
    EXPECT_TRUE(std::isfinite(row.train_loss));
    EXPECT_TRUE(std::isfinite(row.test_loss));
  }
  const HistoryRow& last = run.history.back();
  if (method.inverts) {
    EXPECT_EQ(last.by_inverse + last.by_numerical_inverse +
                  last.by_inverse_gradient + last.by_gradient + last.not_moved,
              kNumSteps * kBatchSize)
        << run.summary.message;
  } else {
    EXPECT_TRUE(std::isnan(last.by_inverse)) << "nothing was inverted";
  }
  if (method.loss_falls) {
    EXPECT_LT(last.train_loss, run.history.front().train_loss);
    EXPECT_LT(last.test_loss, run.history.front().test_loss);
  }
}

constexpr const char* kProblems[] = {
    "oscillator_tracking:num_samples=32:horizon=8",
    "oscillator_correction:num_samples=32:horizon=4"};

INSTANTIATE_TEST_SUITE_P(ProblemsAndMethods,
                         ClosedLoopTraining,
                         testing::Combine(testing::ValuesIn(kProblems),
                                          testing::ValuesIn(kCases)));

// Differentiable physics is the gradient of the closed loop, whoever computes
// it.
TEST(ClosedLoop, DifferentiablePhysicsIsTheRuleAlone) {
  for (const char* problem : kProblems) {
    SCOPED_TRACE(problem);
    const TrainResult chain = Train(problem, "dp_adam");
    const TrainResult alone = Train(problem, "adam");
    EXPECT_LT((chain.weights - alone.weights).norm(),
              1e-9 * alone.weights.norm());
  }
}

// A closed loop has no exact Hessian.
TEST(ClosedLoop, NewtonIsRefusedBeforeTheRun) {
  const LearningProblem problem = CreateLearningProblem(kProblems[0]);
  TrainOptions options;
  options.max_num_steps = 1;
  for (const char* method : {"newton", "newton/joint/saddle_free_newton"}) {
    const TrainResult run =
        invgrad::Train(*problem.model, {problem.train, {}}, method, options);
    EXPECT_NE(run.error.find("closed loop has no exact Hessian"),
              std::string::npos)
        << run.error;
    EXPECT_TRUE(run.history.empty());
  }
}

}  // namespace closed_loop_training_test
}  // namespace invgrad
