// Training, pull-backs and Ceres with a network of libtorch.

#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/ceres.h"
#include "gtest/gtest.h"
#include "invgrad/cost.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace torch_training_test {

using Eigen::VectorXd;

LearningProblem HeatWithUNet() {
  return CreateLearningProblem(
      "heat:resolution=8:network=u_net:levels=2:filters=4:num_samples=8:"
      "nu_t=0.5:fresh_data=true");
}

TrainOptions Steps(long num_steps) {
  TrainOptions options;
  options.batch_size = 8;
  options.max_num_steps = num_steps;
  return options;
}

class EveryMethod : public testing::TestWithParam<std::string> {};

TEST_P(EveryMethod, LowersTheTestLossAndResumesBitForBit) {
  const LearningProblem problem = HeatWithUNet();
  const TemporaryFolder folder;
  const TrainResult whole = TrainProblem(problem, GetParam(), Steps(20));
  EXPECT_LT(whole.history.back().test_loss,
            0.8 * whole.history.front().test_loss);
  TrainOptions options = Steps(9);
  options.checkpoint_path = folder / "checkpoint";
  options.checkpoint_interval_in_seconds = 0.0;
  TrainProblem(problem, GetParam(), options);
  options.max_num_steps = 20;
  const TrainResult resumed = TrainProblem(problem, GetParam(), options);
  EXPECT_EQ(resumed.summary.num_steps, 20);
  EXPECT_EQ(resumed.weights, whole.weights);
}

INSTANTIATE_TEST_SUITE_P(
    UNet,
    EveryMethod,
    testing::Values("adam:step_size=1e-2",
                    "sip:step_size=1e-2",
                    "kfac:step_size=0.1:damping=1",
                    "newton/inverse/kfac:interval=3",
                    "krylov:iterations=10",
                    "newton/inverse/krylov:iterations=10"));

TEST(UNetTraining, RulesWithoutFactorsAreTooLarge) {
  const LearningProblem problem =
      CreateLearningProblem("heat:resolution=64:network=u_net:num_samples=128");
  TrainOptions options = Steps(1);
  options.batch_size = 128;
  options.memory_limit = 8e9;
  const TrainResult result =
      Train(*problem.model, problem.train, "half_inverse", options);
  EXPECT_NE(result.error.find("needs"), std::string::npos) << result.error;
}

TEST(UNetTraining, ACeresMinimizerTrainsIt) {
  const LearningProblem problem = HeatWithUNet();
  const TrainResult result = TrainProblem(problem, "ceres_lbfgs", Steps(10));
  EXPECT_LT(result.history.back().train_loss,
            0.5 * result.history.front().train_loss);
}

TEST(UNetTraining, TheCostFunctionHasTheModelsGradient) {
  const LearningProblem problem = HeatWithUNet();
  const Model& model = *problem.model;
  VectorXd weights = InitialWeights(problem);
  Linearization at;
  LinearizationParts parts;
  parts.gradient = true;
  std::string error;
  ASSERT_TRUE(model.Linearize(weights, problem.train, parts, &at, &error));
  ceres::Problem ceres_problem;
  AddModelToProblem(model, problem.train, weights.data(), &ceres_problem);
  EXPECT_EQ(ceres_problem.NumParameterBlocks(),
            static_cast<int>(model.network().WeightBlocks().size()));
  double cost = 0.0;
  std::vector<double> gradient;
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = WeightBlocks(model.network(), weights.data());
  ASSERT_TRUE(
      ceres_problem.Evaluate(options, &cost, nullptr, &gradient, nullptr));
  EXPECT_NEAR(cost, at.cost, 1e-6 * at.cost);
  EXPECT_LT((Eigen::Map<const VectorXd>(gradient.data(), weights.size()) -
             at.gradient)
                .norm(),
            1e-4 * at.gradient.norm());
}

// The stream of samples is a function of the step.
TEST(FreshData, AreTheSameForAllRunsAndNewAtEveryStep) {
  const LearningProblem problem = HeatWithUNet();
  const LearningProblem again = HeatWithUNet();
  ASSERT_NE(problem.source, nullptr);
  const DataSet batch = problem.source->Batch(3, 8, *problem.model, {});
  EXPECT_EQ(batch.inputs, again.source->Batch(3, 8, *problem.model, {}).inputs);
  EXPECT_NE(batch.inputs,
            problem.source->Batch(4, 8, *problem.model, {}).inputs);
  EXPECT_EQ(batch.inputs.leftCols(5),
            problem.source->Batch(3, 5, *problem.model, {}).inputs);
  VectorXd y(batch.targets.rows());
  ASSERT_TRUE(problem.model->simulator().Evaluate(
      batch.solutions.col(7).data(), nullptr, y.data(), nullptr));
  EXPECT_EQ(batch.targets.col(7), y);
}

}  // namespace torch_training_test
}  // namespace invgrad
