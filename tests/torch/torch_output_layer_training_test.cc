// Training of networks of libtorch whose output layer is solved.

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "Eigen/QR"
#include "gtest/gtest.h"
#include "invgrad/train/train.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
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

// The loss of the best output layer for the hidden weights, in double precision.
double BestLoss(const VectorXd& weights, const DataSet& data) {
  const MatrixXd W =
      weights.head(kNumInputs * kNumHidden).reshaped(kNumInputs, kNumHidden);
  const VectorXd b = weights.segment(kNumInputs * kNumHidden, kNumHidden);
  MatrixXd H = MatrixXd::Ones(data.num_samples(), kNumHidden + 1);
  H.leftCols(kNumHidden) =
      ((data.inputs.transpose() * W).rowwise() + b.transpose()).array().tanh();
  const MatrixXd Y = data.targets.transpose();
  const MatrixXd C = H.colPivHouseholderQr().solve(Y);
  return 0.5 * (H * C - Y).squaredNorm() / data.num_samples();
}

// The features have relative errors of 1e-7, and C is rounded to 6e-8: the loss
// changes by less than 1e-6 of itself, as its targets are no smaller than x.
TEST(TorchOutputLayerTraining, EveryStepEndsWithTheBestLayer) {
  const LearningProblem problem = Regression(Hidden());
  for (const std::string method :
       {"supervised:output_layer=exact:step_size=1e-3",
        "adam:output_layer=exact:step_size=1e-3"}) {
    double last = HUGE_VAL;
    for (const int num_steps : {1, 2, 5}) {
      const TrainResult result =
          TrainProblem(problem, method, Epochs(num_steps));
      const double loss = result.history.back().train_loss;
      const double best = BestLoss(result.weights, problem.train);
      EXPECT_NEAR(loss, best, 1e-5 * best) << method;
      EXPECT_LT(loss, last) << method;
      last = loss;
    }
  }
}

TEST(TorchOutputLayerTraining, AModuleThatEndsInAnActivation) {
  nn::Sequential module = Hidden();
  module->push_back(nn::Tanh());
  const LearningProblem problem = Regression(module);
  TrainOptions options = Epochs(1);
  options.initial_weights = InitialWeights(problem);
  const TrainResult result = Train(*problem.model,
                                   {problem.train, problem.test},
                                   "supervised:output_layer=exact",
                                   options);
  EXPECT_EQ(
      result.error,
      "output_layer=exact: the network test, 39 weights, 2 to 3, single "
      "does not end in a layer that is affine in its weights: let it end "
      "in a linear layer or a 1 x 1 convolution without an activation, or "
      "leave the option off");
}

class UNetWithAnExactLayer : public testing::TestWithParam<std::string> {};

TEST_P(UNetWithAnExactLayer, LowersTheLossAndResumesBitForBit) {
  const LearningProblem problem = CreateLearningProblem(
      "poisson_inverse:resolution=8:network=u_net:levels=2:filters=4:"
      "num_samples=160");
  const std::string method =
      GetParam() + ":output_layer=exact:output_layer_period=4";
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

INSTANTIATE_TEST_SUITE_P(Poisson,
                         UNetWithAnExactLayer,
                         testing::Values("adam:step_size=1e-3",
                                         "supervised:step_size=1e-3",
                                         "sip:step_size=1e-3",
                                         "kfac:step_size=0.1:damping=1",
                                         "newton/inverse/kfac:interval=3",
                                         "krylov:iterations=10",
                                         "newton/inverse/krylov"));

}  // namespace torch_output_layer_training_test
}  // namespace invgrad
