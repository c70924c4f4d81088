// Methods in phases: one run that is, phase by phase, the runs of its parts.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ceres/iteration_callback.h"
#include "gtest/gtest.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/train/train.h"
#include "problems/problems.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace {

// y = a^2 to be learnt by 1-3-1 from 12 samples, without solutions.
struct Parabola {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Parabola(int num_hidden = 3)
      : model(DenseNetwork({1, num_hidden, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::make_shared<SquaredNormLoss>(1, 1.0),
              Reduction::kMean) {
    NumpyRandom random(5);
    train.inputs = random.Rand(1, 12);
    train.contexts.resize(0, 12);
    train.targets = train.inputs.array().square();
    test = train.Range(0, 4);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }
};

Method Parse(const std::string& text) {
  std::vector<Method> methods;
  std::string error;
  EXPECT_TRUE(ParseMethods(text, &methods, &error)) << error;
  EXPECT_EQ(methods.size(), 1u);
  return methods.at(0);
}

TrainResult TrainBy(const std::string& method,
                    TrainOptions options,
                    const Parabola& problem,
                    const Eigen::VectorXd& weights) {
  options.initial_weights = weights;
  return Train(problem.model, {problem.train, problem.test}, method, options);
}

TrainResult TrainBy(const std::string& method, const TrainOptions& options) {
  const Parabola problem;
  return TrainBy(method, options, problem, problem.weights);
}

TrainOptions Epochs(int num_epochs) {
  TrainOptions options;
  options.max_num_epochs = num_epochs;
  options.batch_size = 0;
  return options;
}

bool IsSame(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// But for the seconds.
void ExpectSameRow(const HistoryRow& row, const HistoryRow& expected) {
  EXPECT_EQ(row.step, expected.step);
  EXPECT_EQ(row.epoch, expected.epoch);
  EXPECT_TRUE(IsSame(row.batch_loss, expected.batch_loss));
  EXPECT_EQ(row.train_loss, expected.train_loss);
  EXPECT_EQ(row.test_loss, expected.test_loss);
  EXPECT_TRUE(IsSame(row.step_norm, expected.step_norm));
  EXPECT_TRUE(IsSame(row.by_inverse, expected.by_inverse));
}

void ExpectSameRun(const TrainResult& result, const TrainResult& expected) {
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.weights, expected.weights);
  EXPECT_EQ(result.summary.num_steps, expected.summary.num_steps);
  ASSERT_EQ(result.history.size(), expected.history.size());
  for (size_t i = 0; i < expected.history.size(); ++i) {
    SCOPED_TRACE(i);
    ExpectSameRow(result.history[i], expected.history[i]);
  }
}

// --- Parsing ---

TEST(Phases, AMethodIsAListOfPhases) {
  const Method method = Parse(
      "adam:step_size=1e-3:batch_size=4:epochs=5 > sip:steps=7>half_inverse:"
      "truncation=1e-3");
  ASSERT_EQ(method.phases.size(), 3u);
  EXPECT_EQ(method.phases[0].label,
            "adam:step_size=1e-3:batch_size=4:epochs=5");
  EXPECT_EQ(method.phases[0].batch_size, 4);
  EXPECT_EQ(method.phases[0].num_epochs, 5);
  EXPECT_EQ(method.phases[0].num_steps, 0);
  EXPECT_TRUE(method.phases[1].pull_back.has_value());
  EXPECT_EQ(method.phases[1].num_steps, 7);
  const Phase& last = method.last_phase();
  EXPECT_EQ(last.rule->name, "half_inverse");
  EXPECT_EQ(last.rule_settings, (Settings{{"truncation", "1e-3"}}));
  EXPECT_EQ(last.batch_size, -1);
  EXPECT_EQ(last.num_epochs, 0);
  EXPECT_EQ(Parse("adam").phases.size(), 1u);
}

TEST(Phases, RefusesSharesThatAreMissingOrHaveNoMeaning) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"adam>half_inverse", "'adam' needs epochs=N or steps=N"},
      {"adam:epochs=5", "the last one takes what is left"},
      {"adam:epochs=1>half_inverse:steps=5", "'half_inverse:steps=5'"},
      {"adam:epochs=0>half_inverse", "epochs=0 is out of range"},
      {"adam:steps=1.5>half_inverse", "steps=1.5"},
      {"adam:epochs=1:epochs=2>half_inverse", "epochs is given twice"},
      {"ceres_lm:epochs=5>adam", "can only be the last phase"},
      {"ceres_lm+adam:epochs=5>adam", "can only be the last phase"},
      {"adam:epochs=5>", "does not start with a name"},
      {">adam", "does not start with a name"},
      {"adam:epochs=5>adm", "unknown rule 'adm'; did you mean adam"},
      {"sip:epoch=5>adam", "did you mean epochs"},
      {"adam:epochs=5>adam,adam:epochs=5>adam", "twice"}};
  for (const auto& [text, words] : cases) {
    SCOPED_TRACE(text);
    std::vector<Method> methods;
    std::string error;
    EXPECT_FALSE(ParseMethods(text, &methods, &error));
    EXPECT_NE(error.find(words), std::string::npos) << error;
  }
}

// --- Training ---

class ShuffledOrNot : public ::testing::TestWithParam<bool> {};

TEST_P(ShuffledOrNot, TwoPhasesAreTwoRunsBitForBit) {
  const std::vector<std::pair<std::string, std::string>> pairs = {
      {"adam:step_size=1e-2:schedule=cosine:batch_size=4",
       "half_inverse:truncation=1e-3:batch_size=6"},
      {"sip:step_size=1e-2:batch_size=3", "adam:schedule=cosine:batch_size=5"},
      {"half_inverse:batch_size=12", "sip:batch_size=4"},
      {"adam", "ceres_lm"}};
  for (const auto& [first, second] : pairs) {
    SCOPED_TRACE(first + ">" + second);
    const Parabola problem;
    TrainOptions options = Epochs(3);
    options.shuffle = GetParam();
    options.seed = 7;
    const TrainResult pre_training =
        TrainBy(first, options, problem, problem.weights);
    options.max_num_epochs = 4;
    TrainResult expected =
        TrainBy(second, options, problem, pre_training.weights);
    const long num_steps = pre_training.summary.num_steps;
    History rows = pre_training.history;
    for (size_t i = 1; i < expected.history.size(); ++i) {
      rows.push_back(expected.history[i]);
      rows.back().step += num_steps;
      rows.back().epoch += 3.0;
    }
    expected.history = rows;
    expected.summary.num_steps += num_steps;

    options.max_num_epochs = 7;
    const TrainResult result = TrainBy(
        first + ":epochs=3>" + second, options, problem, problem.weights);
    ExpectSameRun(result, expected);
    EXPECT_EQ(result.summary.termination_type, ceres::NO_CONVERGENCE);
    EXPECT_EQ(result.summary.message.rfind("epochs done", 0), 0u)
        << result.summary.message;
    EXPECT_EQ(result.history.back().epoch, 7.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Phases, ShuffledOrNot, ::testing::Bool());

// Records what it sees, and stops the run at a step.
class Watcher final : public ceres::IterationCallback {
 public:
  explicit Watcher(int last_step = -1) : last_step_(last_step) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    steps.push_back(iteration.iteration);
    seconds.push_back(iteration.cumulative_time_in_seconds);
    return iteration.iteration == last_step_
               ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
               : ceres::SOLVER_CONTINUE;
  }
  std::vector<int> steps;
  std::vector<double> seconds;

 private:
  const int last_step_;
};

TEST(Phases, CallbacksSeeOneRun) {
  Watcher watcher;
  TrainOptions options = Epochs(5);
  options.callbacks = {&watcher};
  std::vector<long> evaluated;
  options.on_evaluation = [&evaluated](const Eigen::VectorXd&,
                                       const History& history) {
    evaluated.push_back(history.back().step);
  };
  // 3 and 4 steps an epoch.
  const TrainResult result = TrainBy(
      "adam:batch_size=4:epochs=2>gauss_newton:batch_size=3:epochs=1>"
      "adam:batch_size=4",
      options);
  ASSERT_EQ(result.error, "");
  ASSERT_EQ(watcher.steps.size(), 1u + 2 * 3 + 4 + 2 * 3);
  for (size_t i = 0; i < watcher.steps.size(); ++i) {
    EXPECT_EQ(watcher.steps[i], static_cast<int>(i));
    if (i > 0) {
      EXPECT_GE(watcher.seconds[i], watcher.seconds[i - 1]);
    }
  }
  EXPECT_EQ(evaluated, (std::vector<long>{0, 3, 6, 10, 13, 16}));
  ASSERT_EQ(result.history.size(), evaluated.size());
  EXPECT_EQ(result.history.back().seconds,
            result.summary.train_time_in_seconds);
}

TEST(Phases, TheBudgetIsThatOfTheWholeRun) {
  const std::string method = "adam:batch_size=4:epochs=5>adam:batch_size=6";
  // Within the first phase, of 3 steps an epoch.
  TrainResult result = TrainBy(method, Epochs(2));
  EXPECT_EQ(result.summary.num_steps, 6);
  EXPECT_EQ(result.summary.message, "epochs done");
  TrainOptions options;
  options.max_num_steps = 7;
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.num_steps, 7);
  EXPECT_EQ(result.summary.message, "steps done");
  // At its end, and behind it.
  EXPECT_EQ(TrainBy(method, Epochs(5)).summary.num_steps, 15);
  EXPECT_EQ(TrainBy(method, Epochs(6)).summary.num_steps, 15 + 2);
  options.max_num_steps = 20;
  EXPECT_EQ(TrainBy(method, options).summary.num_steps, 20);
  options.max_time_in_seconds = 0.0;
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.num_steps, 0);
  EXPECT_EQ(result.summary.message, "time used up");
  // Of two shares the first one that is used up counts.
  EXPECT_EQ(TrainBy("adam:batch_size=4:epochs=5:steps=4>adam:batch_size=12",
                    Epochs(2))
                .summary.num_steps,
            4 + 1);
}

// 4 steps of 3 are 4/3 epochs; of 2 an epoch, 4 more reach the third epoch.
TEST(Phases, AnEpochBudgetEndsWithTheStepThatReachesIt) {
  const std::string method = "adam:batch_size=4:steps=4>adam:batch_size=6";
  const TrainResult result = TrainBy(method, Epochs(3));
  EXPECT_EQ(result.summary.num_steps, 4 + 4);
  EXPECT_EQ(result.summary.message, "epochs done");
  EXPECT_DOUBLE_EQ(result.history.back().epoch, 4.0 / 3.0 + 2.0);
  // The end of the first phase, within an epoch, was looked at once.
  std::vector<long> steps;
  for (const HistoryRow& row : result.history) steps.push_back(row.step);
  EXPECT_EQ(steps, (std::vector<long>{0, 3, 4, 6, 8}));
}

// (2 - 11 / 12) 12 is 13.000000000000002 in floating point.
TEST(Phases, RoundingAddsNoStepToAnEpochBudget) {
  for (int first = 1; first < 24; ++first) {
    const TrainResult result =
        TrainBy("adam:batch_size=1:steps=" + std::to_string(first) +
                    ">adam:batch_size=1",
                Epochs(2));
    EXPECT_EQ(result.summary.num_steps, 24) << first;
    EXPECT_EQ(result.summary.message, "epochs done");
  }
}

// Steps far too long, which no phase keeps.
TEST(Phases, StepsTakenBackAreAddedUp) {
  const TrainResult result = TrainBy(
      "half_inverse:step_size=1e4:control=gain:epochs=3>"
      "half_inverse:step_size=1e4:control=gain",
      Epochs(5));
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.summary.num_updates, 5);
  EXPECT_EQ(result.summary.num_taken_back, 5);
  EXPECT_EQ(result.summary.message, "epochs done; 5 of 5 steps taken back");
}

TEST(Phases, EpochsAreThoseOfEachPhase) {
  const Parabola problem;
  TrainOptions options = Epochs(6);
  options.batch_size = 6;
  TrainingRun run(problem.model,
                  problem.train,
                  "adam:batch_size=4:epochs=2>adam:steps=3>ceres_lm",
                  options);
  // 3 steps an epoch, then 2 of the run's 6 samples, then one.
  std::vector<double> epochs = {run.epoch()};
  while (run.Step() && run.step() < 11) epochs.push_back(run.epoch());
  EXPECT_EQ(epochs[0], 0.0);
  EXPECT_EQ(epochs[3], 1.0);
  EXPECT_EQ(epochs[6], 2.0);
  EXPECT_EQ(epochs[8], 3.0);
  EXPECT_EQ(epochs[9], 3.5);
  EXPECT_EQ(epochs[10], 4.5);
}

TEST(Phases, WhatEndsARunEndsItInAnyPhase) {
  const std::string method = "adam:batch_size=4:epochs=2>adam:batch_size=4";
  Watcher early(4);
  TrainOptions options = Epochs(5);
  options.callbacks = {&early};
  TrainResult result = TrainBy(method, options);
  EXPECT_EQ(result.summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(result.summary.num_steps, 4);
  EXPECT_EQ(result.summary.message, "phase 1: stopped by a callback at step 4");

  Watcher late(8);
  options.callbacks = {&late};
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.num_steps, 8);
  EXPECT_EQ(result.summary.message, "phase 2: stopped by a callback at step 2");

  options = Epochs(5);
  options.target_loss = 1e6;
  result = TrainBy(method, options);
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 0);

  result = TrainBy("gradient_descent:step_size=1e200:epochs=2>adam", Epochs(5));
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(result.summary.message.rfind("phase 1: diverged", 0), 0u)
      << result.summary.message;
  // The second phase diverges as a run of its own: at its own step.
  const std::string diverging = "gradient_descent:step_size=1e200";
  const std::string alone = TrainBy(diverging, Epochs(5)).summary.message;
  result = TrainBy("adam:batch_size=4:epochs=2>" + diverging, Epochs(5));
  EXPECT_EQ(result.summary.message, "phase 2: " + alone);
  EXPECT_EQ(alone.rfind("diverged at step ", 0), 0u) << alone;

  // No step of any size is a new minimum.
  options = Epochs(50);
  options.patience = 2;
  result = TrainBy(
      "gradient_descent:step_size=1e-300:epochs=20>gradient_descent", options);
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 2);
}

TEST(Phases, ARunThatIsStoppedGoesOnBitForBit) {
  const Parabola problem;
  const std::string method =
      "adam:step_size=1e-2:batch_size=4:epochs=3>sip:batch_size=3:steps=5>"
      "rmsprop:batch_size=5";
  TrainOptions options = Epochs(8);
  options.shuffle = true;
  const TrainResult whole = TrainBy(method, options, problem, problem.weights);

  const TemporaryFolder folder;
  options.checkpoint_path = folder / "checkpoint";
  const auto stop_at = [&](int step) {
    Watcher watcher(step);
    TrainOptions stopped = options;
    stopped.callbacks = {&watcher};
    return TrainBy(method, stopped, problem, problem.weights);
  };
  // 9 steps, then 5, then 2 an epoch: within each, at an end, by budgets.
  for (const int step : {4, 9, 11, 14, 17}) {
    SCOPED_TRACE(step);
    EXPECT_EQ(stop_at(step).summary.num_steps, step);
  }
  EXPECT_TRUE(std::filesystem::exists(options.checkpoint_path));
  ExpectSameRun(TrainBy(method, options, problem, problem.weights), whole);

  // A larger budget in epochs goes on too.
  std::filesystem::remove(options.checkpoint_path);
  for (const int num_epochs : {2, 4, 8}) {
    options.max_num_epochs = num_epochs;
    const TrainResult result =
        TrainBy(method, options, problem, problem.weights);
    ASSERT_EQ(result.error, "");
    if (num_epochs == 8) ExpectSameRun(result, whole);
  }
}

TEST(Phases, BadInputOfAnyPhaseIsRefusedBeforeAnythingRuns) {
  const auto expect = [](const std::string& method,
                         const std::vector<std::string>& words) {
    SCOPED_TRACE(method);
    // With neurons of more weights than a rule can propose.
    const Parabola problem(3000);
    Watcher watcher;
    TrainOptions options = Epochs(5);
    options.callbacks = {&watcher};
    const TrainResult result =
        TrainBy(method, options, problem, problem.weights);
    EXPECT_NE(result.error, "");
    for (const std::string& word : words) {
      EXPECT_NE(result.error.find(word), std::string::npos) << result.error;
    }
    EXPECT_EQ(result.weights, problem.weights);
    EXPECT_TRUE(result.history.empty());
    EXPECT_TRUE(watcher.steps.empty());
  };
  expect("adam:epochs=1>supervised", {"supervised: ", "no solutions"});
  expect("adam:epochs=1>adam:batch_size=13", {"batch_size=13", "12 training"});
  expect("adam:epochs=1:batch_size=13>adam", {"batch_size=13", "12 training"});
  expect("adam:epochs=1>ceres_lm+adam", {"ceres_lm+adam: ", "block"});
}

// A rule judges its steps by the loss on the same inputs, and a pull-back has
// to be on the same inputs too: in a closed loop the step moves them.
TEST(Phases, AControlledPullBackInAClosedLoopIsRefusedBeforeAnythingRuns) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(CreateProblem("oscillator_tracking:num_samples=16:horizon=2",
                            nullptr,
                            &problem,
                            &error))
      << error;
  const LearningProblem& learning = *problem.learning;
  NumpyRandom random(1);
  const Eigen::VectorXd initial_weights =
      learning.model->network().InitialWeights(learning.initialization,
                                               &random);
  const std::string phase = "gradient/adjoint/half_inverse:control=gain";
  for (const std::string& method :
       {"adam:epochs=1>" + phase, phase + ":epochs=1>adam", phase}) {
    SCOPED_TRACE(method);
    Watcher watcher;
    TrainOptions options = Epochs(2);
    options.callbacks = {&watcher};
    options.initial_weights = initial_weights;
    options.inverse = learning.inverse;
    const TrainResult result = Train(
        *learning.model, {learning.train, learning.test}, method, options);
    error = result.error;
    EXPECT_NE(error.find("control=gain: in a closed loop"), std::string::npos)
        << error;
    if (method != phase) {
      EXPECT_EQ(error.rfind(phase, 0), 0u) << error;
    }
    EXPECT_EQ(result.weights, initial_weights);
    EXPECT_TRUE(result.history.empty());
    EXPECT_TRUE(watcher.steps.empty());
  }
}

TEST(Phases, MemoryIsAskedForBeforeAnythingRuns) {
  const Parabola problem(300);
  Watcher watcher;
  TrainOptions options = Epochs(5);
  options.callbacks = {&watcher};
  options.memory_limit = 1e6;  // a Hessian of 901 weights needs 6.5 MB
  EXPECT_EQ(TrainBy("adam", options, problem, problem.weights).error, "");
  watcher.steps.clear();
  const TrainResult result =
      TrainBy("adam:epochs=1>newton", options, problem, problem.weights);
  EXPECT_NE(result.error, "");
  EXPECT_NE(result.error.find("newton: batch_size=12 needs "),
            std::string::npos)
      << result.error;
  EXPECT_TRUE(watcher.steps.empty());
}

TEST(Phases, ACheckpointOfAnotherNetworkIsRefused) {
  const TemporaryFolder folder;
  TrainOptions options = Epochs(3);
  options.checkpoint_path = folder / "checkpoint";
  const std::string method = "adam:epochs=1>adam";
  const Parabola small;
  ASSERT_EQ(TrainBy(method, options, small, small.weights).error, "");
  const Parabola large(5);
  const TrainResult result = TrainBy(method, options, large, large.weights);
  EXPECT_NE(result.error, "");
  EXPECT_NE(result.error.find("checkpoint: array 'weights'"), std::string::npos)
      << result.error;
  EXPECT_EQ(result.weights, large.weights);
}

TEST(Phases, APointHasNone) {
  ChainObjective objective(std::make_shared<IdentitySimulator>(1),
                           std::make_shared<SquaredNormLoss>(1, 1.0),
                           Eigen::VectorXd::Zero(1),
                           Eigen::VectorXd::Ones(1));
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  EXPECT_FALSE(MinimizeByMethod(Parse("adam:steps=1>newton"),
                                MinimizerOptions(),
                                nullptr,
                                &objective,
                                &path,
                                &summary,
                                &error));
  EXPECT_NE(error.find("phases"), std::string::npos) << error;
}

}  // namespace
}  // namespace invgrad
