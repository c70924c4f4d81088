// Training of networks of libtorch whose output layer is solved.

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/output_layer/reduced_objective.h"
#include "invgrad/output_layer/share.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
#include "tests/support/least_squares.h"
#include "tests/support/random_matrix.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/support/train_problem.h"
#include "tests/torch/sequential_network.h"

namespace invgrad {
namespace torch_output_layer_training_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
namespace nn = torch::nn;

constexpr int kNumInputs = 2, kNumHidden = 6, kNumOutputs = 3;

// x* of random numbers, for a network in single precision.
LearningProblem Regression(const nn::Sequential& module) {
  constexpr int kNumSamples = 40;
  LearningProblem problem;
  problem.model = std::make_shared<Model>(
      MakeSequential(module, {kNumInputs}, /*double_precision=*/false),
      std::make_shared<IdentitySimulator>(kNumOutputs),
      std::make_shared<SquaredNormLoss>(kNumOutputs, 0.5),
      Reduction::kMean);
  problem.train.inputs = RandomMatrix(kNumInputs, kNumSamples, 1);
  problem.train.contexts.resize(0, kNumSamples);
  problem.train.targets = problem.train.solutions =
      RandomMatrix(kNumOutputs, kNumSamples, 2);
  return problem;
}

nn::Sequential Hidden() {
  return nn::Sequential(nn::Linear(kNumInputs, kNumHidden),
                        nn::Tanh(),
                        nn::Linear(kNumHidden, kNumOutputs));
}

// The best output layer for the hidden weights, in double precision.
struct BestLayer {
  BestLayer(const VectorXd& weights, const DataSet& data) {
    const auto N = static_cast<double>(data.num_samples());
    const MatrixXd W =
        weights.head(kNumInputs * kNumHidden).reshaped(kNumInputs, kNumHidden);
    const VectorXd b = weights.segment(kNumInputs * kNumHidden, kNumHidden);
    MatrixXd H = MatrixXd::Ones(data.num_samples(), kNumHidden + 1);
    H.leftCols(kNumHidden) =
        ((data.inputs.transpose() * W).rowwise() + b.transpose())
            .array()
            .tanh();
    const MatrixXd Y = data.targets.transpose();
    const MatrixXd C = LeastSquares(H, Y);
    const double norm = (H * C - Y).norm();
    loss = 0.5 * norm * norm / N;
    // An output is a sum of 7 products, with |h| <= 1, of rounded factors: at
    // most 16 roundings of 6e-8.
    const double change = 16.0 * 6e-8 * C.cwiseAbs().colwise().sum().maxCoeff();
    tolerance = norm * std::sqrt(N * kNumOutputs) * change / N;
  }
  double loss;
  double tolerance;
};

// Far from where tanh is linear, so that the features differ.
VectorXd Weights(const Model& model) {
  return 3.0 * RandomMatrix(model.num_weights(), 1, 3);
}

TEST(TorchOutputLayerTraining, TheSolvedLayerIsTheBest) {
  const LearningProblem problem = Regression(Hidden());
  const Model& model = *problem.model;
  ReducedObjective reduced(
      std::make_unique<ModelObjective>(model), &model, nullptr);
  VectorXd weights = Weights(model);
  std::string error;
  ASSERT_TRUE(reduced.SolveOutputLayer(problem.train, &weights, &error))
      << error;
  EXPECT_EQ(reduced.Unknowns(weights), reduced.Unknowns(Weights(model)));
  const BestLayer best(weights, problem.train);
  EXPECT_NEAR(
      MeanLoss(model, weights, problem.train), best.loss, best.tolerance);
}

TEST(TorchOutputLayerTraining, ARunEndsWithNearlyTheBestLayer) {
  const LearningProblem problem = Regression(Hidden());
  for (const int batch_size : {8, 0}) {
    SCOPED_TRACE(batch_size);
    TrainOptions options = Epochs(3, batch_size);
    options.initial_weights = Weights(*problem.model);
    const TrainResult result = TrainProblem(
        problem, "supervised:output_layer=exact:step_size=1e-3", options);
    const double loss = result.history.back().train_loss;
    const BestLayer best(result.weights, problem.train);
    EXPECT_GT(loss, best.loss - best.tolerance);
    // Cross-validation adds about p / (m - p): 7 features, 40 samples.
    EXPECT_LT(0.7 * loss, best.loss);
    EXPECT_LT(loss, result.history.front().train_loss);
  }
}

TEST(TorchOutputLayerTraining, AModuleThatEndsInAnActivation) {
  nn::Sequential module = Hidden();
  module->push_back(nn::Tanh());
  const LearningProblem problem = Regression(module);
  TrainOptions options = Epochs(1);
  options.initial_weights = VectorXd::Zero(problem.model->num_weights());
  const TrainResult result = Train(*problem.model,
                                   {problem.train, problem.test},
                                   "supervised:output_layer=exact",
                                   options);
  EXPECT_NE(result.error.find("does not end in a layer that is affine in its "
                              "weights"),
            std::string::npos)
      << result.error;
}

class UNetWithAnExactLayer : public testing::TestWithParam<std::string> {};

constexpr char kUNet[] =
    "poisson_inverse:resolution=8:network=u_net:levels=2:filters=4:"
    "num_samples=160";

void LowersTheLossAndResumes(const LearningProblem& problem,
                             const std::string& rule) {
  const std::string method = rule + ":output_layer=exact:output_layer_period=4";
  const TemporaryFolder folder;
  TrainOptions options = Epochs(1, 8);
  options.max_num_steps = 12;
  const TrainResult whole = TrainProblem(problem, method, options);
  EXPECT_LT(whole.history.back().train_loss,
            0.8 * whole.history.front().train_loss);
  options.checkpoint_path = folder / "checkpoint";
  options.checkpoint_interval_in_seconds = 0.0;
  options.max_num_steps = 5;
  TrainProblem(problem, method, options);
  options.max_num_steps = 12;
  const TrainResult resumed = TrainProblem(problem, method, options);
  EXPECT_EQ(resumed.weights, whole.weights);
}

TEST_P(UNetWithAnExactLayer, LowersTheLossAndResumesBitForBit) {
  LowersTheLossAndResumes(CreateLearningProblem(kUNet), GetParam());
}

// The layer is solved on fresh samples, too.
TEST(TorchOutputLayerTraining, OnFreshSamples) {
  LowersTheLossAndResumes(
      CreateLearningProblem(std::string(kUNet) + ":fresh_data=true"),
      "sip:step_size=1e-3");
}

// 8 x 8 equations of a sample are as alike as one.
TEST(TorchOutputLayerTraining, AShareHasSixteenSamplesForEachUnknown) {
  const LearningProblem problem = CreateLearningProblem(kUNet);
  const LayerColumns layer = OutputLayerOf(problem.model->network());
  EXPECT_EQ(SamplesOfShare(*problem.model, true), 16 * layer.rows());
  EXPECT_EQ(SamplesOfBlock(*problem.model, true), 32);
}

INSTANTIATE_TEST_SUITE_P(
    Poisson,
    UNetWithAnExactLayer,
    testing::Values("adam:step_size=1e-3",
                    "supervised:step_size=1e-3",
                    "sip:step_size=1e-3",
                    "kfac:step_size=0.1:damping=1",
                    "newton/inverse/kfac:interval=3",
                    "krylov:iterations=10",
                    "newton/inverse/krylov:iterations=10"));

}  // namespace torch_output_layer_training_test
}  // namespace invgrad
