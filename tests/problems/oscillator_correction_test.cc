#include "problems/oscillator_correction.h"

#include <cmath>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "problems/problems.h"
#include "tests/support/take_steps.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace oscillator_correction_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LearningProblem Create(const OscillatorCorrection& options) {
  LearningProblem problem;
  std::string error;
  EXPECT_TRUE(options.Create(&problem, &error)) << error;
  return problem;
}

// Without correction the trajectory is that of the coarse method, of order one
// in dt.
TEST(OscillatorCorrection, CoarseStepIsOfOrderOne) {
  const auto error_at = [](int horizon) {
    OscillatorCorrection options;
    options.horizon = horizon;
    options.dt = 2.0 / horizon;
    options.num_samples = 2;
    const LearningProblem problem = Create(options);
    const Simulator& simulator = problem.model->simulator();
    const VectorXd zero = VectorXd::Zero(simulator.num_inputs());
    VectorXd y(simulator.num_outputs());
    EXPECT_TRUE(simulator.Evaluate(
        zero.data(), problem.train.contexts.col(0).data(), y.data(), nullptr));
    return (y - problem.train.targets.col(0)).tail(4).norm();
  };
  EXPECT_NEAR(std::log2(error_at(256) / error_at(512)), 1.0, 0.05);
}

// The states of the fine solution do not depend on how the horizon is cut into
// steps, up to its own error of order four.
TEST(OscillatorCorrection, FineSolutionHasConverged) {
  OscillatorCorrection options;
  options.num_samples = 3;
  const LearningProblem once = Create(options);
  options.horizon *= 2;
  options.dt = 0.125;  // half of the default
  const LearningProblem twice = Create(options);
  EXPECT_EQ(once.train.inputs, twice.train.inputs);
  EXPECT_LT(
      (once.train.targets.bottomRows(4) - twice.train.targets.bottomRows(4))
          .norm(),
      1e-6);
}

// The missing part of each step as correction: the fine trajectory, no loss.
TEST(OscillatorCorrection, RightCorrectionGivesTheFineTrajectory) {
  OscillatorCorrection options;
  options.dt = 0.25;
  const LearningProblem problem = Create(options);
  const Simulator& simulator = problem.model->simulator();
  const Feedback& loop = *problem.model->feedback();
  const VectorXd target = problem.train.targets.col(0);
  VectorXd x(simulator.num_inputs());
  VectorXd state = problem.train.contexts.col(0);
  const VectorXd zero = VectorXd::Zero(4);
  VectorXd coarse(4);
  for (int t = 0; t < options.horizon; ++t) {
    ASSERT_TRUE(loop.Advance(state.data(), zero.data(), coarse.data()));
    state = target.segment(4 * t, 4);
    x.segment(4 * t, 4) = (state - coarse) / options.dt;
  }
  VectorXd y(simulator.num_outputs());
  ASSERT_TRUE(simulator.Evaluate(
      x.data(), problem.train.contexts.col(0).data(), y.data(), nullptr));
  EXPECT_LT((y - target).norm(), 1e-13);
  EXPECT_GT(x.norm(), 0.1);
}

TEST(OscillatorCorrection, ShortTrainingBeatsTheCoarseSimulator) {
  OscillatorCorrection options;
  options.num_samples = 64;
  const LearningProblem problem = Create(options);
  std::string error;
  // All weights zero: no correction.
  double coarse = 0.0;
  ASSERT_TRUE(problem.model->Cost(VectorXd::Zero(problem.model->num_weights()),
                                  problem.train,
                                  &coarse,
                                  &error))
      << error;
  VectorXd weights = InitialWeights(problem, 0);
  TakeSteps(problem, "half_inverse:step_size=auto", 16, 40, &weights);
  double trained = 0.0;
  ASSERT_TRUE(problem.model->Cost(weights, problem.train, &trained, &error));
  EXPECT_LT(trained, 0.25 * coarse);
}

// By default, chains of all lengths can be trained from the first seeds.
TEST(OscillatorCorrection, LongerChainsStayNearTheFineSolution) {
  for (const int num_oscillators : {4, 8, 16}) {
    OscillatorCorrection options;
    options.num_oscillators = num_oscillators;
    options.num_samples = 128;
    const LearningProblem problem = Create(options);
    for (const int seed : {1, 2, 3}) {
      double cost = 0.0;
      std::string error;
      EXPECT_TRUE(problem.model->Cost(
          InitialWeights(problem, seed), problem.train, &cost, &error))
          << error;
      EXPECT_LT(cost, 100.0) << num_oscillators << " seed " << seed;
    }
  }
}

}  // namespace oscillator_correction_test
}  // namespace invgrad
