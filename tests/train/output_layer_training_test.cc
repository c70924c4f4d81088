// Runs whose output layer is solved and not trained.

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/loss.h"
#include "invgrad/output_layer/reduced_objective.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/create_problem.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/support/train_problem.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace output_layer_training_test {

using Eigen::VectorXd;

constexpr char kExact[] = ":output_layer=exact";
// Of the network 2-5-2 of Regression.
constexpr int kLayerSize = 12;

TrainResult TrainBy(const Regression& problem,
                    const std::string& method,
                    TrainOptions options) {
  options.initial_weights = problem.weights;
  TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_EQ(result.error, "") << method;
  return result;
}

class EveryRuleWithAnExactLayer : public ::testing::TestWithParam<std::string> {
};

// On batches, and on all samples at once.
TEST_P(EveryRuleWithAnExactLayer, ResumesBitForBit) {
  const Regression problem;
  for (const int batch_size : {8, 0}) {
    const TemporaryFolder folder;
    TrainOptions options = Epochs(6, batch_size);
    options.shuffle = true;
    const std::string method = GetParam() + kExact;
    const TrainResult whole = TrainBy(problem, method, options);
    EXPECT_NE(whole.summary.termination_type, ceres::FAILURE)
        << "batches of " << batch_size << ": " << whole.summary.message;
    options.checkpoint_path = folder / "checkpoint";
    options.checkpoint_interval_in_seconds = 0.0;
    options.max_num_epochs = 3;
    TrainBy(problem, method, options);
    options.max_num_epochs = 6;
    const TrainResult resumed = TrainBy(problem, method, options);
    EXPECT_EQ(resumed.weights, whole.weights);
    ASSERT_EQ(resumed.history.size(), whole.history.size());
    for (size_t i = 0; i < whole.history.size(); ++i) {
      EXPECT_EQ(resumed.history[i].train_loss, whole.history[i].train_loss);
    }
  }
}

std::vector<std::string> RuleNames() {
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(OutputLayer,
                         EveryRuleWithAnExactLayer,
                         ::testing::ValuesIn(RuleNames()),
                         [](const auto& info) { return info.param; });

// The loss of the best layer for the hidden weights of a result, over the loss
// of the result.
double BestOverFound(const Regression& problem, const TrainResult& result) {
  ReducedObjective reduced(
      std::make_unique<ModelObjective>(problem.model), &problem.model, nullptr);
  VectorXd weights = result.weights;
  std::string error;
  EXPECT_TRUE(reduced.SolveOutputLayer(problem.train, &weights, &error))
      << error;
  return MeanLoss(problem.model, weights, problem.train) /
         result.history.back().train_loss;
}

// After a few steps, while the loss is far from rounding errors.
TEST(OutputLayerTraining, TheResultHasTheBestLayer) {
  const Regression problem;
  const TrainResult on_all =
      TrainBy(problem, std::string("geodesic") + kExact, Epochs(3, 0));
  EXPECT_GT(BestOverFound(problem, on_all), 1.0 - 1e-6);
  const TrainResult on_batches =
      TrainBy(problem, std::string("adam") + kExact, Epochs(50, 8));
  // Cross-validation adds about p / (m - p) to the loss: 6 features, 24 samples.
  EXPECT_GT(BestOverFound(problem, on_batches), 0.7);
}

TEST(OutputLayerTraining, LowersTheLossBelowThatOfATrainedLayer) {
  const Regression problem;
  for (const int batch_size : {0, 8}) {
    for (const std::string method :
         {"adam:step_size=3e-3", "levenberg_marquardt:step_size=auto"}) {
      const double trained = TrainBy(problem, method, Epochs(30, batch_size))
                                 .history.back()
                                 .train_loss;
      const double solved =
          TrainBy(problem, method + kExact, Epochs(30, batch_size))
              .history.back()
              .train_loss;
      EXPECT_LT(solved, trained) << method << ", batches of " << batch_size;
    }
  }
}

// The rule's step and the layer's solution leave the loss of all samples no
// higher where the rule undoes what raises it.
TEST(OutputLayerTraining, UnderControlTheLossFallsOnAllSamples) {
  const Regression problem;
  for (const std::string rule : {"geodesic", "half_inverse:control=gain"}) {
    const TrainResult result = TrainBy(problem, rule + kExact, Epochs(30, 0));
    for (size_t i = 1; i < result.history.size(); ++i) {
      EXPECT_LE(result.history[i].train_loss,
                result.history[i - 1].train_loss * (1.0 + 1e-9))
          << rule;
    }
  }
}

TEST(OutputLayerTraining, APhaseOfItsOwn) {
  const Regression problem;
  const TrainResult result =
      TrainBy(problem,
              "adam:epochs=5>adam:output_layer=exact:output_layer_period=2",
              Epochs(20, 8));
  EXPECT_LT(result.history.back().train_loss,
            0.5 * result.history.front().train_loss);
}

// Targets of the pull-back, new at every step; and over time, where x holds the
// outputs of all calls.
TEST(OutputLayerTraining, TowardsTheTargetsOfPullBacks) {
  for (const auto& [name, method] :
       {std::pair("sine", "sip:step_size=1e-3"),
        std::pair("heat_1d", "supervised:step_size=1e-3"),
        std::pair("oscillator_tracking:num_samples=64:horizon=6",
                  "newton/inverse_gradient/adam:step_size=1e-3")}) {
    const LearningProblem problem = CreateLearningProblem(name);
    const TrainResult result =
        TrainProblem(problem, std::string(method) + kExact, Epochs(3, 16));
    const HistoryRow& last = result.history.back();
    EXPECT_TRUE(std::isfinite(last.train_loss)) << name;
    EXPECT_LT(last.train_loss, result.history.front().train_loss * 1.001)
        << name;
  }
}

// --- Bad input ---

TEST(OutputLayerTraining, SettingsThatDoNotFit) {
  const Regression problem;
  EXPECT_EQ(Refusal(problem, Epochs(1), "adam:output_layer_period=3"),
            "adam: output_layer_period needs output_layer=exact or auto");
  EXPECT_NE(Refusal(problem, Epochs(1), "adam:output_layer=solved")
                .find("trained, exact, auto"),
            std::string::npos);
  EXPECT_NE(Refusal(problem, Epochs(1), "ceres_lm:output_layer=exact")
                .find("choose an update rule"),
            std::string::npos);
}

struct FourthPower {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T d = y[0] - target[0];
    *loss = d * d * d * d + y[1] * y[1];
    return true;
  }
};

TEST(OutputLayerTraining, ALossThatIsNoSumOfSquares) {
  Regression problem;
  problem.model = problem.model.WithLoss(
      std::make_shared<AutoDiffLoss<FourthPower, 2>>(), Reduction::kMean);
  const std::string error =
      Refusal(problem, Epochs(1), std::string("adam") + kExact);
  EXPECT_NE(error.find("no sum of squares"), std::string::npos) << error;
  EXPECT_NE(error.find("newton/inverse_gradient/adam"), std::string::npos);
}

TEST(OutputLayerTraining, ANetworkWithoutAHiddenLayer) {
  Regression problem;
  problem.model =
      problem.model.WithNetwork(DenseNetwork({2, 2}, Activation::kTanh));
  problem.weights = VectorXd::Zero(6);
  const std::string error =
      Refusal(problem, Epochs(1), std::string("adam") + kExact);
  EXPECT_NE(error.find("add a hidden layer"), std::string::npos) << error;
}

TEST(OutputLayerTraining, FeaturesThatOverflow) {
  Regression problem;
  problem.model =
      problem.model.WithNetwork(DenseNetwork({2, 5, 2}, Activation::kRelu));
  problem.weights.head(problem.weights.size() - kLayerSize).setConstant(1e200);
  TrainOptions options = Epochs(1, 8);
  options.initial_weights = problem.weights;
  const TrainResult result = Train(problem.model,
                                   {problem.train, problem.test},
                                   std::string("adam") + kExact,
                                   options);
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_NE(result.summary.message.find("not finite"), std::string::npos)
      << result.summary.message;
  EXPECT_EQ(result.weights, problem.weights);
}

}  // namespace output_layer_training_test
}  // namespace invgrad
