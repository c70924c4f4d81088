// Training through pull-backs: what the history counts, and that the counts,
// the fall-backs and a resumed run are what they should be.
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/train/rule_engine.h"
#include "invgrad/update_rule.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace pull_back_training_test {

TrainOptions Steps(long num_steps) {
  TrainOptions options;
  options.max_num_steps = num_steps;
  options.batch_size = 100;
  return options;
}

TEST(PullBackTraining, ThreadsOfTheRunDoNotChangeABit) {
  const LearningProblem chain =
      CreateLearningProblem("oscillator_chain:num_samples=64");
  const LearningProblem loop =
      CreateLearningProblem("oscillator_tracking:num_samples=64:horizon=6");
  const auto train = [](const LearningProblem& problem,
                        const std::string& method,
                        int num_threads) {
    TrainOptions options = Steps(4);
    options.batch_size = 30;
    options.num_threads = num_threads;
    return TrainProblem(problem, method, options);
  };
  for (const LearningProblem* problem : {&chain, &loop}) {
    for (const char* method : {"adam", "half_inverse", "sip"}) {
      const TrainResult one = train(*problem, method, 1);
      EXPECT_EQ(one.error, "") << method;
      for (const int num_threads : {2, 3}) {
        const TrainResult several = train(*problem, method, num_threads);
        EXPECT_EQ(several.weights, one.weights) << method;
        EXPECT_EQ(several.history.back().train_loss,
                  one.history.back().train_loss)
            << method;
      }
    }
  }
}

// Differentiable physics is the gradient of the chain, whoever computes it.
TEST(PullBackTraining, DifferentiablePhysicsIsTheRuleAlone) {
  const LearningProblem problem =
      CreateLearningProblem("sine:xi=2:phi=10:num_samples=200");
  const TrainResult chain = TrainProblem(problem, "dp_adam", Steps(20));
  const TrainResult alone = TrainProblem(problem, "adam", Steps(20));
  EXPECT_LT((chain.weights - alone.weights).norm(),
            1e-10 * alone.weights.norm());
  EXPECT_TRUE(std::isnan(chain.history.back().by_inverse))
      << "nothing was inverted";
}

TEST(PullBackTraining, HalfInverseGradientsAreTheRuleAlone) {
  const LearningProblem problem =
      CreateLearningProblem("sine:xi=2:phi=10:num_samples=200");
  const TrainResult chain =
      TrainProblem(problem, "hig:step_size=0.01", Steps(3));
  const TrainResult alone =
      TrainProblem(problem, "half_inverse:step_size=0.01", Steps(3));
  EXPECT_EQ(chain.weights, alone.weights);
}

// Gradient descent on the proxy that notes the costs that it is told.
class NotingRule final : public UpdateRule, public StepJudge {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    before.push_back(at_x.cost);
    *step = -1e-3 * at_x.gradient;
    return true;
  }
  StepJudge* judge() override { return this; }
  bool KeepsStep(double cost, double) override {
    after.push_back(cost);
    return true;
  }
  std::vector<double> before;
  std::vector<double> after;
};

// Steps are judged by the proxy that they were computed from, whose targets
// stay where they are, and not by the loss.
TEST(PullBackTraining, TheProxyIsWhatIsJudged) {
  const LearningProblem problem =
      CreateLearningProblem("sine:xi=2:phi=10:num_samples=100");
  const TrainingData data(problem.train);
  for (const int num_updates : {1, 3}) {
    SCOPED_TRACE(num_updates);
    ChainPullBack::Options options;
    options.updates_per_evaluation = num_updates;
    const auto rule = std::make_shared<NotingRule>();
    RuleEngine engine(100,
                      TrainOptions(),
                      std::make_unique<ChainPullBack>(
                          problem.model.get(), problem.inverse, options),
                      rule,
                      problem.model.get(),
                      &data);
    const Eigen::VectorXd start = InitialWeights(problem);
    Eigen::VectorXd weights = start;
    EXPECT_EQ(engine.Step(0.0, &weights).outcome,
              Engine::StepResult::Outcome::kStepped);
    ASSERT_EQ(rule->before.size(), static_cast<size_t>(num_updates));
    ASSERT_EQ(rule->after.size(), rule->before.size());
    ChainPullBack again(problem.model.get(), problem.inverse, options);
    LinearizationParts parts;
    parts.gradient = true;
    Linearization proxy;
    std::string error;
    Eigen::VectorXd at = start;
    ASSERT_TRUE(again.Linearize(at, problem.train, parts, &proxy, &error));
    for (int k = 0; k < num_updates; ++k) {
      ASSERT_TRUE(
          again.LinearizeAgain(at, problem.train, parts, &proxy, &error));
      EXPECT_EQ(rule->before[k], proxy.cost);
      at -= 1e-3 * proxy.gradient;
      ASSERT_TRUE(
          again.LinearizeAgain(at, problem.train, parts, &proxy, &error));
      EXPECT_EQ(rule->after[k], proxy.cost);
      EXPECT_LT(rule->after[k], rule->before[k]);
    }
    EXPECT_EQ(at, weights);
  }
}

// A proxy whose targets lie too far cannot be seen to by its own judge: with
// the adjoint the change of y has to be small.
TEST(PullBackTraining, ControlTrainsThroughPullBacks) {
  const LearningProblem problem =
      CreateLearningProblem("sine:xi=2:phi=10:num_samples=200");
  for (const char* method :
       {"newton/inverse/half_inverse:control=gain",
        "newton/inverse/gauss_newton:control=gain",
        "newton/adjoint/power:step_size=auto:control=gain:y_step_size=0.01"}) {
    SCOPED_TRACE(method);
    const TrainResult run = TrainProblem(problem, method, Steps(60));
    EXPECT_EQ(run.summary.num_steps, 60) << run.summary.message;
    EXPECT_LT(run.summary.num_undone, 30);
    EXPECT_LT(run.history.back().train_loss,
              0.5 * run.history.front().train_loss);
  }
}

struct Scaled {
  double c;
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = c * (x[0] + 0.1 * x[0] * x[0] * x[0]);
    return true;
  }
};

// With targets c sin(2 a).
TrainResult TrainInUnits(double c, const std::string& method) {
  const Model model(
      DenseNetwork({1, 8, 1}, Activation::kTanh),
      std::make_shared<AutoDiffSimulator<Scaled, 1, 1>>(Scaled{c}),
      std::make_shared<SquaredNormLoss>(1, 0.5),
      Reduction::kMean);
  const Eigen::RowVectorXd inputs =
      Eigen::RowVectorXd::LinSpaced(40, -1.0, 1.0);
  TrainOptions options;
  options.max_num_steps = 100;
  return Train(
      model, {inputs, c * (2.0 * inputs.array()).sin()}, method, options);
}

// The loss is in the unit of y, the proxy in that of x.
TEST(PullBackTraining, TrialsAreComparedWithTheProxyAtTheWeights) {
  for (const std::string rule : {"geodesic", "adaptive", "ssbroyden"}) {
    for (const double c : {1e-3, 1.0, 1e3}) {
      SCOPED_TRACE(rule + " " + std::to_string(c));
      const TrainResult result =
          TrainInUnits(c, "newton/inverse/" + rule + ":batch_size=0");
      EXPECT_EQ(result.error, "");
      EXPECT_LT(result.history.back().train_loss,
                1e-3 * result.history.front().train_loss);
    }
  }
}

TEST(PullBackTraining, AStepInYHasNoCostToCompare) {
  for (const std::string rule : {"geodesic",
                                 "adaptive",
                                 "ssbroyden",
                                 "hessian_free",
                                 "half_inverse:control=gain"}) {
    SCOPED_TRACE(rule);
    for (const std::string& method :
         {"newton/joint/" + rule,
          "gradient/joint/" + rule + ":y_step_size=2"}) {
      EXPECT_EQ(TrainInUnits(1.0, method).error.find("the rule compares costs"),
                0u);
    }
    EXPECT_EQ(TrainInUnits(1.0, "gradient/joint/" + rule).error, "");
  }
  EXPECT_EQ(TrainInUnits(1.0, "newton/joint/half_inverse").error, "");
}

TEST(PullBackTraining, EverySampleIsCountedOnce) {
  const LearningProblem problem =
      CreateLearningProblem("sine:xi=4:num_samples=200");
  const TrainResult run = TrainProblem(problem, "sip", Steps(7));
  EXPECT_EQ(run.history.back().by_inverse, 700.0);
  EXPECT_EQ(run.history.back().by_numerical_inverse, 0.0);
  EXPECT_EQ(run.history.back().by_inverse_gradient, 0.0);
  EXPECT_EQ(run.history.back().by_gradient, 0.0);
  EXPECT_EQ(run.history.back().not_moved, 0.0);
  EXPECT_NE(run.summary.message.find("700 inverse"), std::string::npos)
      << run.summary.message;
}

// Wrong, NaN and throwing on three quarters of its domain: numerical answers
// take over, training goes on as if nothing had happened, and it is told.
TEST(PullBackTraining, AWrongInverseIsCaughtAndCounted) {
  const LearningProblem wrong =
      CreateLearningProblem("multimodal:wrong_inverse=true:num_samples=400");
  const LearningProblem right =
      CreateLearningProblem("multimodal:num_samples=400");
  const TrainResult run = TrainProblem(wrong, "sip", Steps(400));
  const TrainResult reference = TrainProblem(right, "sip", Steps(400));
  EXPECT_LT(run.history.back().test_loss, 0.05 * run.history.front().test_loss);
  EXPECT_LT(run.history.back().test_loss,
            2.0 * reference.history.back().test_loss);
  // The mean of |x*| > 1/2 is half of the samples: y > 1/4.
  EXPECT_NEAR(run.history.back().by_numerical_inverse / 40000.0, 0.5, 0.1);
  EXPECT_NEAR(run.history.back().by_inverse / 40000.0, 0.5, 0.1);
  EXPECT_EQ(run.history.back().by_inverse +
                run.history.back().by_numerical_inverse +
                run.history.back().by_inverse_gradient +
                run.history.back().by_gradient + run.history.back().not_moved,
            40000.0);
  EXPECT_NE(run.summary.message.find("(first at step 1, sample"),
            std::string::npos)
      << run.summary.message;
}

TEST(PullBackTraining, AResumedRunEndsWithTheSameBitsAndCounts) {
  const LearningProblem problem =
      CreateLearningProblem("multimodal:wrong_inverse=true:num_samples=400");
  const std::string method = "sip:updates=2:curvature_weight=0.5";
  const TrainResult whole = TrainProblem(problem, method, Steps(30));
  const TemporaryFolder folder;
  TrainOptions options = Steps(13);
  options.checkpoint_path = folder / "checkpoint";
  TrainProblem(problem, method, options);
  options.max_num_steps = 30;
  const TrainResult resumed = TrainProblem(problem, method, options);
  EXPECT_EQ(resumed.weights, whole.weights);
  EXPECT_EQ(resumed.history.back().by_inverse, whole.history.back().by_inverse);
  EXPECT_EQ(resumed.history.back().by_numerical_inverse,
            whole.history.back().by_numerical_inverse);
  EXPECT_EQ(resumed.history.back().by_inverse +
                resumed.history.back().by_numerical_inverse,
            3000.0);
}

TEST(PullBackTraining, ThreadsDoNotChangeABit) {
  const LearningProblem problem =
      CreateLearningProblem("multimodal:wrong_inverse=true:num_samples=400");
  const TrainResult one = TrainProblem(problem, "sip", Steps(20));
  TrainOptions options = Steps(20);
  options.num_threads = 3;
  const TrainResult three = TrainProblem(problem, "sip", options);
  EXPECT_EQ(one.weights, three.weights);
  EXPECT_EQ(one.summary.message, three.summary.message);
}

// One evaluation of the simulator, four of the network.
TEST(PullBackTraining, SeveralUpdatesPerEvaluationGoFurther) {
  const LearningProblem problem =
      CreateLearningProblem("exponential:num_samples=400");
  const TrainResult one =
      TrainProblem(problem, "sip:step_size=1e-4", Steps(40));
  const TrainResult four =
      TrainProblem(problem, "sip:step_size=1e-4:updates=4", Steps(40));
  EXPECT_EQ(one.history.back().by_inverse, four.history.back().by_inverse);
  EXPECT_LT(four.history.back().test_loss, one.history.back().test_loss);
}

// Supervised training averages the two pre-images; an inverse keeps to one.
TEST(PullBackTraining, SupervisedTrainingAveragesAndInversionDoesNot) {
  LearningProblem problem =
      CreateLearningProblem("multimodal:num_samples=1000");
  const auto metric = [&](const TrainResult& run) {
    DenseNetwork::Activations forward;
    std::string error;
    EXPECT_TRUE(problem.model->Forward(run.weights,
                                       problem.test,
                                       Network::Derivatives::kFirst,
                                       &forward,
                                       &error));
    return problem.metric->evaluate(forward.outputs, problem.test);
  };
  // The mean of |x*| is 1/2, that of a fit to its own noise somewhat less.
  EXPECT_GT(metric(TrainProblem(problem, "supervised", Steps(1500))), 0.4);
  EXPECT_LT(metric(TrainProblem(problem, "sip", Steps(1500))), 0.05);
  EXPECT_LT(metric(TrainProblem(problem, "dp_adam", Steps(1500))), 0.05);
}

// P(x) = x^2 + 1 never reaches y* = 0.
struct Shifted {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[0] + 1.0;
    return true;
  }
};

TEST(PullBackTraining, ATargetOutOfRangeFallsBackAndIsReported) {
  LearningProblem problem = CreateLearningProblem("multimodal:num_samples=100");
  problem.model = std::make_shared<Model>(
      problem.model->shared_network(),
      std::make_shared<AutoDiffSimulator<Shifted, 1, 1>>(),
      problem.model->shared_loss(),
      Reduction::kMean);
  problem.train.targets.setZero();
  problem.test.targets.setZero();
  const TrainResult run =
      TrainProblem(problem, "newton/numerical/adam", Steps(500));
  EXPECT_EQ(run.history.back().by_numerical_inverse, 0.0);
  EXPECT_GT(
      run.history.back().by_inverse_gradient + run.history.back().by_gradient,
      0.0);
  EXPECT_NE(run.summary.message.find("% of the way"), std::string::npos)
      << run.summary.message;
  // The best is x = 0, L = 1/2.
  EXPECT_NEAR(run.history.back().test_loss, 0.5, 0.01);
  const TrainResult nearer = TrainProblem(
      problem, "newton/numerical/adam:accept_nearer=true", Steps(500));
  EXPECT_GT(nearer.history.back().by_numerical_inverse, 0.0);
  EXPECT_NEAR(nearer.history.back().test_loss, 0.5, 0.01);
}

// What an inverse says stands in files of one line a run.
TEST(PullBackTraining, ReasonsAreOneLine) {
  LearningProblem problem = CreateLearningProblem("multimodal:num_samples=100");
  problem.inverse =
      Inverse([](const auto&, const auto&) -> std::optional<Eigen::VectorXd> {
        throw std::runtime_error("two\nlines\r");
      });
  const TrainResult run = TrainProblem(problem, "sip", Steps(2));
  EXPECT_EQ(run.history.back().by_inverse, 0.0);
  EXPECT_NE(run.summary.message.find("the inverse threw: two lines "),
            std::string::npos)
      << run.summary.message;
  EXPECT_EQ(run.summary.message.find('\n'), std::string::npos);
}

TEST(PullBackTraining, SupervisionNeedsSolutions) {
  const LearningProblem problem = CreateLearningProblem("sine:num_samples=200");
  const std::string error =
      Train(*problem.model, problem.train, "supervised", Steps(1)).error;
  EXPECT_NE(error.find("no solutions"), std::string::npos) << error;
}

}  // namespace pull_back_training_test
}  // namespace invgrad
