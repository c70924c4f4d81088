// output_layer=auto: a solved layer where it pays, and otherwise a trained one.

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/option_set.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "invgrad/update_rule.h"
#include "tests/support/create_problem.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/support/train_problem.h"
#include "tests/train/parabola.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace output_layer_fallback_test {

// Adam, whose step `last` blows the weights up and is the last one.
class FailingAdam final : public UpdateRule {
 public:
  struct Options {
    int last = 1000;
    void Describe(OptionSet* set) {
      set->Add("last", &last, {1, 1000000}, "the last step");
    }
  };
  explicit FailingAdam(const Options& options)
      : last_(options.last), adam_(MakeRule("adam:step_size=1e-3")) {}
  LinearizationParts Needs() const override { return adam_->Needs(); }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    *error = "no step";
    if (++step_ > last_ || !adam_->ComputeStep(at_x, step, error)) return false;
    if (step_ == last_) step->array() += 1e3;
    return true;
  }

 private:
  const int last_;
  int step_ = 0;
  const std::unique_ptr<UpdateRule> adam_;
};

struct Root {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sqrt;
    y[0] = sqrt(x[0] + 0.25);
    return true;
  }
};

constexpr char kAuto[] = ":output_layer=auto";

TrainOptions Steps(long num_steps, int batch_size) {
  TrainOptions options;
  options.max_num_steps = num_steps;
  options.batch_size = batch_size;
  return options;
}

TrainResult TrainRegressionBy(const std::string& method, TrainOptions options) {
  const Regression problem;
  options.initial_weights = problem.weights;
  TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_EQ(result.error, "") << method;
  return result;
}

// One input and three hidden layers: the features are nearly dependent.
const LearningProblem& OfOneInput() {
  static const auto* const problem = new LearningProblem(
      CreateLearningProblem("regression_1d:num_samples=320"));
  return *problem;
}

constexpr long kNumSteps = 4000;
// The steps of a stalled layer: before the last one a tenth is spent.
constexpr long kNumSolvedSteps = kNumSteps / 10 + 1;

TEST(OutputLayerFallback, ALayerThatPaysIsSolvedToTheEnd) {
  for (const int batch_size : {0, 8}) {
    const std::string method = "adam:step_size=3e-3";
    const TrainOptions options = Steps(800, batch_size);
    const TrainResult exact =
        TrainRegressionBy(method + ":output_layer=exact", options);
    const TrainResult result = TrainRegressionBy(method + kAuto, options);
    EXPECT_EQ(result.weights, exact.weights);
    EXPECT_EQ(result.history.size(), exact.history.size());
    EXPECT_EQ(result.summary.message, exact.summary.message);
  }
}

TEST(OutputLayerFallback, AStalledPhaseTrainsAllLayersFromItsFirstWeights) {
  const std::string method = "adam:step_size=1e-3";
  const TrainResult result =
      TrainProblem(OfOneInput(), method + kAuto, Steps(kNumSteps, 32));
  const TrainResult trained = TrainProblem(
      OfOneInput(), method, Steps(kNumSteps - kNumSolvedSteps, 32));
  EXPECT_EQ(result.weights, trained.weights);
  EXPECT_EQ(result.summary.num_steps, kNumSteps);
  EXPECT_NE(result.summary.message.find("final weights of the latter"),
            std::string::npos)
      << result.summary.message;

  const TrainResult exact = TrainProblem(
      OfOneInput(), method + ":output_layer=exact", Steps(kNumSteps, 32));
  EXPECT_LT(result.history.back().train_loss,
            0.1 * exact.history.back().train_loss)
      << "the problem does not show why there is a fallback";
}

// The trained phase fails; the best weights that it had are still better.
TEST(OutputLayerFallback, AFailureKeepsTheBestOfBothPhases) {
  RegisterRule<FailingAdam>("failing_adam", "adam");
  const TrainResult result = TrainProblem(
      OfOneInput(), std::string("failing_adam") + kAuto, Steps(kNumSteps, 32));
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_NE(result.summary.message.find("final weights of the latter"),
            std::string::npos)
      << result.summary.message;
  double lowest = std::numeric_limits<double>::infinity();
  for (const HistoryRow& row : result.history) {
    if (row.step > kNumSolvedSteps) lowest = std::min(lowest, row.train_loss);
  }
  EXPECT_EQ(MeanLoss(*OfOneInput().model, result.weights, OfOneInput().train),
            lowest);
}

// Steps of 1e-12 change no loss, but the first solution of the layer does.
TEST(OutputLayerFallback, KeepsTheWeightsOfTheSolutionsIfTheyAreBetter) {
  const std::string method = "adam:step_size=1e-12:output_layer_period=1";
  const TrainOptions options = Steps(800, 8);
  const TrainResult exact =
      TrainRegressionBy(method + ":output_layer=exact", options);
  const TrainResult trained =
      TrainRegressionBy("adam:step_size=1e-12", options);
  const TrainResult result = TrainRegressionBy(method + kAuto, options);
  const double loss = result.history.back().train_loss;
  EXPECT_NEAR(loss, exact.history.back().train_loss, 1e-6 * loss);
  EXPECT_LT(loss, 0.9 * trained.history.back().train_loss);
  const Regression problem;
  EXPECT_EQ(MeanLoss(problem.model, result.weights, problem.train), loss);
  EXPECT_EQ(MeanLoss(problem.model, result.weights, problem.test),
            result.history.back().test_loss);
  EXPECT_NE(result.summary.message.find("final weights of the former"),
            std::string::npos)
      << result.summary.message;
}

TEST(OutputLayerFallback, TheNextPhaseBeginsWithTheBetterWeights) {
  const std::string still =
      "adam:step_size=1e-12:output_layer_period=1:steps=800";
  const std::string last = ">gradient_descent:step_size=0.1";
  const TrainOptions options = Steps(900, 8);
  const TrainResult exact =
      TrainRegressionBy(still + ":output_layer=exact" + last, options);
  const TrainResult result = TrainRegressionBy(still + kAuto + last, options);
  EXPECT_NEAR(result.history.back().train_loss,
              exact.history.back().train_loss,
              0.01 * exact.history.back().train_loss);
  EXPECT_EQ(result.summary.num_steps, 900);
}

TEST(OutputLayerFallback, ResumesBitForBit) {
  const std::string method = std::string("adam:step_size=1e-3") + kAuto;
  const TrainResult whole =
      TrainProblem(OfOneInput(), method, Steps(kNumSteps, 32));
  for (const int stop : {300, 2000}) {
    const TemporaryFolder folder;
    TrainOptions options = Steps(kNumSteps, 32);
    options.checkpoint_path = folder / "checkpoint";
    StopAt callback(stop);
    options.callbacks = {&callback};
    TrainProblem(OfOneInput(), method, options);
    options.callbacks.clear();
    const TrainResult resumed = TrainProblem(OfOneInput(), method, options);
    EXPECT_EQ(resumed.weights, whole.weights) << "stopped at " << stop;
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
  }
}

TEST(OutputLayerFallback, PatienceEndsTheSolvedLayerFirst) {
  TrainOptions options = Steps(kNumSteps, 32);
  options.patience = 5;
  const std::string method = "adam:step_size=1e-3";
  const TrainResult exact =
      TrainProblem(OfOneInput(), method + ":output_layer=exact", options);
  ASSERT_LT(exact.summary.num_steps, kNumSteps / 10)
      << "the patience lasts until the fall is judged";
  const TrainResult result =
      TrainProblem(OfOneInput(), method + kAuto, options);
  EXPECT_GT(result.summary.num_steps, exact.summary.num_steps);
  EXPECT_NE(result.summary.message.find("then trained"), std::string::npos)
      << result.summary.message;
}

// Outputs of large layers overflow behind the exponential.
TEST(OutputLayerFallback, ALayerThatDivergesIsTrained) {
  const LearningProblem problem =
      CreateLearningProblem("exponential:num_samples=128");
  const std::string method = "supervised:step_size=1e-3";
  const TrainOptions options = Steps(kNumSteps, 32);
  const TrainResult exact =
      TrainProblem(problem, method + ":output_layer=exact", options);
  ASSERT_EQ(exact.summary.termination_type, ceres::FAILURE)
      << "the problem does not show why there is a fallback";
  const TrainResult result = TrainProblem(problem, method + kAuto, options);
  EXPECT_NE(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(result.summary.num_steps, kNumSteps);
  EXPECT_LT(result.history.back().train_loss, exact.history.front().train_loss);
}

// From x = 0, where y = 1/2, a least-squares solution for y = -1 leaves the
// domain x > -1/4 of the simulator. Small steps do not.
TEST(OutputLayerFallback, ALayerWithoutAFiniteLossIsTrainedFromTheStart) {
  const Parabola parabola;
  const Model model(DenseNetwork({1, 3, 1}, Activation::kTanh),
                    std::make_shared<AutoDiffSimulator<Root, 1, 1>>(),
                    std::make_shared<SquaredNormLoss>(1, 0.5),
                    Reduction::kMean);
  DataSet train = parabola.train;
  train.targets.setConstant(-1.0);
  TrainOptions options = Steps(20, 4);
  options.initial_weights = parabola.weights;
  // The output layer.
  options.initial_weights.tail(4).setZero();
  const std::string method = "newton/inverse_gradient/adam:step_size=1e-3";
  const TrainResult trained = Train(model, train, method, options);
  ASSERT_NE(trained.summary.termination_type, ceres::FAILURE)
      << trained.summary.message;

  const TrainResult result = Train(model, train, method + kAuto, options);
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.weights, trained.weights);
  EXPECT_EQ(result.summary.num_steps, 20);
  ASSERT_EQ(result.history.size(), trained.history.size());
  EXPECT_EQ(result.history[0].train_loss, trained.history[0].train_loss);

  const TrainResult exact =
      Train(model, train, method + ":output_layer=exact", options);
  EXPECT_EQ(exact.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(exact.weights, options.initial_weights);
  const std::string& message = exact.summary.message;
  EXPECT_EQ(message.rfind("the loss is not finite at the initial weights with "
                          "the output layer solved: sample ",
                          0),
            0u)
      << message;
}

}  // namespace output_layer_fallback_test
}  // namespace invgrad
