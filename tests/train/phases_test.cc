// Methods in phases: one run that is, phase by phase, the runs of its parts.

#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "tests/support/parse_method.h"
#include "tests/support/train_options.h"
#include "tests/train/parabola.h"

namespace invgrad {
namespace phases_test {

TEST(Phases, AMethodIsAListOfPhases) {
  const Method method = ParseMethod(
      "adam:step_size=1e-3:batch_size=4:epochs=5 > sip:steps=7>half_inverse:"
      "truncation=1e-3");
  ASSERT_EQ(method.phases.size(), 3u);
  EXPECT_EQ(method.phases[0].label,
            "adam:step_size=1e-3:batch_size=4:epochs=5");
  EXPECT_EQ(method.phases[0].batch_size, 4);
  EXPECT_EQ(method.phases[0].num_epochs, 5);
  EXPECT_EQ(method.phases[0].num_steps, 0);
  EXPECT_TRUE(method.phases[1].pull_back != nullptr);
  EXPECT_EQ(method.phases[1].num_steps, 7);
  const Phase& last = method.last_phase();
  EXPECT_EQ(last.rule->name, "half_inverse");
  EXPECT_EQ(last.rule_settings, (Settings{{"truncation", "1e-3"}}));
  EXPECT_EQ(last.batch_size, -1);
  EXPECT_EQ(last.num_epochs, 0);
  EXPECT_EQ(ParseMethod("adam").phases.size(), 1u);
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

class ShuffledOrNot : public ::testing::TestWithParam<bool> {};

TEST_P(ShuffledOrNot, TwoPhasesAreTwoRunsBitForBit) {
  const std::vector<std::pair<std::string, std::string>> pairs = {
      {"adam:step_size=1e-2:schedule=cosine:batch_size=4",
       "half_inverse:truncation=1e-3:batch_size=6"},
      {"sip:step_size=1e-2:batch_size=3", "adam:schedule=cosine:batch_size=5"},
      {"half_inverse:batch_size=12", "sip:batch_size=4"},
      {"adam:output_layer=exact:batch_size=4", "adam:batch_size=4"},
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

TEST(Phases, CallbacksSeeOneRun) {
  StopAt watcher;
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
  EXPECT_EQ(result.summary.num_undone, 5);
  EXPECT_EQ(result.summary.message, "epochs done; 5 of 5 steps undone");
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
  const std::string trials = "gradient/adjoint/geodesic";
  for (const std::string& method :
       {"adam:epochs=1>" + phase, phase + ":epochs=1>adam", phase, trials}) {
    SCOPED_TRACE(method);
    StopAt watcher;
    TrainOptions options = Epochs(2);
    options.callbacks = {&watcher};
    options.initial_weights = initial_weights;
    options.inverse = learning.inverse;
    const TrainResult result = Train(
        *learning.model, {learning.train, learning.test}, method, options);
    error = result.error;
    EXPECT_NE(error.find("in a closed loop an update moves the inputs"),
              std::string::npos)
        << error;
    if (method != phase && method != trials) {
      EXPECT_EQ(error.rfind(phase, 0), 0u) << error;
    }
    EXPECT_EQ(result.weights, initial_weights);
    EXPECT_TRUE(result.history.empty());
    EXPECT_TRUE(watcher.steps.empty());
  }
}

TEST(Phases, MemoryIsAskedForBeforeAnythingRuns) {
  const Parabola problem(300);
  StopAt watcher;
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

}  // namespace phases_test
}  // namespace invgrad
