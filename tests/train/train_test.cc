#include "invgrad/train/train.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/rules/rules.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/evaluation.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace train_test {

// A regression of y = (a0 a1, a0 - a1) that trains in milliseconds.
struct Regression {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Regression(Reduction reduction = Reduction::kMean)
      : model(DenseNetwork({2, 5, 2}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(2),
              std::make_shared<SquaredNormLoss>(2, 1.0),
              reduction) {
    NumpyRandom random(3);
    train = MakeData(24, &random);
    test = MakeData(10, &random);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }

  static DataSet MakeData(int num_samples, NumpyRandom* random) {
    DataSet data;
    data.inputs = random->Rand(2, num_samples);
    data.contexts.resize(0, num_samples);
    data.targets.resize(2, num_samples);
    data.targets.row(0) = data.inputs.row(0).cwiseProduct(data.inputs.row(1));
    data.targets.row(1) = data.inputs.row(0) - data.inputs.row(1);
    return data;
  }
};

// The caller keeps the rule.
std::shared_ptr<UpdateRule> Borrowed(UpdateRule* rule) {
  return {std::shared_ptr<void>(), rule};
}

TrainResult TrainRegression(const Regression& problem,
                            TrainOptions options,
                            UpdateRule* rule) {
  options.initial_weights = problem.weights;
  TrainResult result = Train(
      problem.model, {problem.train, problem.test}, Borrowed(rule), options);
  EXPECT_EQ(result.error, "");
  return result;
}

// Why the run is refused.
std::string Refusal(const Regression& problem,
                    TrainOptions options,
                    const std::string& method) {
  options.initial_weights = problem.weights;
  const TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_NE(result.error, "");
  EXPECT_EQ(result.weights, problem.weights);
  EXPECT_TRUE(result.history.empty());
  return result.error;
}

TrainOptions Epochs(int num_epochs, int batch_size) {
  TrainOptions options;
  options.max_num_epochs = num_epochs;
  options.batch_size = batch_size;
  return options;
}

TEST(Trainer, OneFullBatchStepOfGradientDescentIsTheGradient) {
  const Regression problem;
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_start;
  std::string error;
  ASSERT_TRUE(problem.model.Linearize(
      problem.weights, problem.train, parts, &at_start, &error));
  const auto rule = MakeRule("gradient_descent:step_size=0.1");
  TrainOptions options = Epochs(1, 0);
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.num_steps, 1);
  EXPECT_LT(
      (result.weights - (problem.weights - 0.1 * at_start.gradient)).norm(),
      1e-15);
  ASSERT_EQ(result.history.size(), 2u);
  EXPECT_EQ(result.history[1].batch_loss, at_start.cost);
  EXPECT_EQ(result.history[0].train_loss, at_start.cost);
  EXPECT_EQ(result.history[1].train_loss,
            MeanLoss(problem.model, result.weights, problem.train));
}

TEST(Trainer, SameInputsGiveTheSameBits) {
  const Regression problem;
  TrainOptions options = Epochs(5, 4);
  options.shuffle = true;
  options.seed = 7;
  const auto first = MakeRule("half_inverse");
  const auto second = MakeRule("half_inverse");
  const TrainResult a = TrainRegression(problem, options, first.get());
  const TrainResult b = TrainRegression(problem, options, second.get());
  EXPECT_EQ(a.weights, b.weights);
  options.seed = 8;
  const auto third = MakeRule("half_inverse");
  EXPECT_NE(TrainRegression(problem, options, third.get()).weights, a.weights);
}

TEST(Trainer, LossIsPerSampleWhateverTheReduction) {
  const Regression mean(Reduction::kMean);
  const Regression sum(Reduction::kSum);
  const double loss = MeanLoss(mean.model, mean.weights, mean.train);
  EXPECT_NEAR(MeanLoss(sum.model, sum.weights, sum.train), loss, 1e-15);
  // The mean over all samples is that over two halves.
  EXPECT_NEAR(
      0.5 * (MeanLoss(mean.model, mean.weights, mean.train.Range(0, 12)) +
             MeanLoss(mean.model, mean.weights, mean.train.Range(12, 12))),
      loss,
      1e-15);
}

TEST(Trainer, SamplesThatDoNotFillABatchAreLeftOut) {
  const Regression problem;  // 24 samples
  const auto rule = MakeRule("adam");
  const TrainResult result = TrainRegression(problem, Epochs(3, 7), rule.get());
  EXPECT_EQ(result.summary.num_steps, 3 * 3);
}

class EveryRuleResumes : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryRuleResumes, BitForBit) {
  const Regression problem;
  const std::string path = ::testing::TempDir() + "trainer_checkpoint_" +
                           GetParam() + std::to_string(::getpid());
  std::remove(path.c_str());
  TrainOptions options = Epochs(6, 8);
  options.shuffle = true;
  const auto whole_rule = MakeRule(GetParam());
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());

  options.checkpoint_path = path;
  options.checkpoint_interval_in_seconds = 0.0;
  options.max_num_epochs = 3;
  const auto first_rule = MakeRule(GetParam());
  TrainRegression(problem, options, first_rule.get());
  options.max_num_epochs = 6;
  const auto second_rule = MakeRule(GetParam());
  const TrainResult resumed =
      TrainRegression(problem, options, second_rule.get());
  std::remove(path.c_str());

  EXPECT_EQ(resumed.weights, whole.weights);
  EXPECT_EQ(resumed.summary.num_steps, whole.summary.num_steps);
  ASSERT_EQ(resumed.history.size(), whole.history.size());
  for (size_t i = 0; i < whole.history.size(); ++i) {
    EXPECT_EQ(resumed.history[i].step, whole.history[i].step);
    EXPECT_EQ(resumed.history[i].train_loss, whole.history[i].train_loss);
    EXPECT_EQ(resumed.history[i].test_loss, whole.history[i].test_loss);
  }
}

std::vector<std::string> RuleNames() {
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Trainer,
                         EveryRuleResumes,
                         ::testing::ValuesIn(RuleNames()),
                         [](const auto& info) { return info.param; });

TEST(Trainer, RefusesACheckpointOfAnotherRun) {
  const Regression problem;
  const std::string path =
      ::testing::TempDir() + "trainer_other_" + std::to_string(::getpid());
  Checkpoint checkpoint;
  checkpoint.arrays["weights"] = Eigen::VectorXd::Zero(3);
  std::string error;
  ASSERT_TRUE(WriteCheckpoint(path, checkpoint, &error)) << error;
  TrainOptions options = Epochs(1, 8);
  options.checkpoint_path = path;
  error = Refusal(problem, options, "adam");
  EXPECT_NE(error.find(path), std::string::npos) << error;
  std::remove(path.c_str());
}

TEST(Trainer, RefusesACheckpointOfAnotherBatchSize) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainOptions options = Epochs(2, 8);
  options.checkpoint_path = folder / "checkpoint";
  const auto rule = MakeRule("adam");
  const TrainResult before = TrainRegression(problem, options, rule.get());
  options.batch_size = 6;
  const std::string error = Refusal(problem, options, "adam");
  EXPECT_NE(error.find("found batch_size=8, wanted 6"), std::string::npos)
      << error;
}

TEST(Trainer, NoBudgetIsNoStep) {
  const Regression problem;
  const auto rule = MakeRule("adam");
  TrainOptions options = Epochs(0, 8);
  EXPECT_EQ(TrainRegression(problem, options, rule.get()).weights,
            problem.weights);
  options = TrainOptions();
  options.max_num_steps = 0;
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.num_steps, 0);
  EXPECT_EQ(result.history.size(), 1u);
}

TEST(Trainer, OneSampleIsAWholeEpoch) {
  Regression problem;
  problem.train = problem.train.Range(0, 1);
  problem.test = problem.test.Range(0, 0);
  const auto rule = MakeRule("half_inverse:step_size=auto");
  const TrainResult result = TrainRegression(problem, Epochs(4, 1), rule.get());
  EXPECT_EQ(result.summary.num_steps, 4);
  EXPECT_LT(result.history.back().train_loss,
            result.history.front().train_loss);
  EXPECT_TRUE(std::isnan(result.history.back().test_loss));
}

// Steps that are fine until `bad_step`, which is `value` everywhere.
class ExplodingRule final : public UpdateRule {
 public:
  ExplodingRule(int bad_step, double value)
      : bad_step_(bad_step), value_(value) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -0.01 * at_x.gradient;
    if (++step_ == bad_step_) step->setConstant(value_);
    return true;
  }

 private:
  int bad_step_;
  double value_;
  int step_ = 0;
};

TEST(Trainer, DivergenceIsReportedAndTheLastGoodWeightsAreKept) {
  const Regression problem;
  for (const double value : {std::nan(""), HUGE_VAL, 1e200}) {
    ExplodingRule rule(5, value);
    const TrainResult result = TrainRegression(problem, Epochs(10, 8), &rule);
    EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
    // Step 5 leads to weights at which step 6 has nothing to linearize.
    EXPECT_EQ(result.summary.message.rfind("diverged at step 6: ", 0), 0u)
        << result.summary.message;
    ExplodingRule same(100, value);
    TrainOptions four_steps;
    four_steps.max_num_steps = 4;
    four_steps.batch_size = 8;
    EXPECT_EQ(result.weights,
              TrainRegression(problem, four_steps, &same).weights);
    EXPECT_TRUE(std::isfinite(result.history.back().train_loss));
  }
}

// Gradient descent that judges its steps as it is told to, and remembers what
// it was asked.
class JudgingRule final : public UpdateRule {
 public:
  using Judgement = std::function<bool(double before, double after)>;
  using Step = std::function<void(int k, Eigen::VectorXd* step)>;
  JudgingRule(Judgement judgement, Step step)
      : judgement_(std::move(judgement)), step_(std::move(step)) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    before.push_back(at_x.cost);
    *step = -0.1 * at_x.gradient;
    step_(static_cast<int>(++num_steps_[0]), step);
    return true;
  }
  bool JudgesSteps() const override { return true; }
  bool KeepsStep(double cost, double fraction) override {
    EXPECT_EQ(fraction, 1.0);
    after.push_back(cost);
    return judgement_(before.empty() ? cost : before.back(), cost);
  }
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {&num_steps_};
  }

  std::vector<double> before;
  std::vector<double> after;

 private:
  Judgement judgement_;
  Step step_;
  Eigen::VectorXd num_steps_ = Eigen::VectorXd::Zero(1);
};

bool IsFinite(double /*before*/, double after) { return std::isfinite(after); }
void NoChange(int /*k*/, Eigen::VectorXd* /*step*/) {}

TEST(Trainer, AStepThatIsTakenBackLeavesNoTrace) {
  const Regression problem;
  JudgingRule rule([](double, double) { return false; }, NoChange);
  const TrainResult result = TrainRegression(problem, Epochs(5, 8), &rule);
  EXPECT_EQ(result.weights, problem.weights);
  EXPECT_EQ(result.summary.num_steps, 15);
  EXPECT_EQ(result.summary.num_taken_back, 15);
  EXPECT_EQ(result.summary.num_updates, 15);
  EXPECT_EQ(result.summary.message, "epochs done; 15 of 15 steps taken back");
  EXPECT_EQ(result.history.back().train_loss,
            result.history.front().train_loss);
  EXPECT_EQ(result.history.back().step_norm, 0.0);
}

// Every third step goes up instead of down.
TEST(Trainer, StepsThatRaiseTheLossOfTheirBatchAreTakenBack) {
  const Regression problem;
  const auto every_third = [](int k, Eigen::VectorXd* step) {
    if (k % 3 == 0) *step = -*step;
  };
  JudgingRule rule([](double before, double after) { return after <= before; },
                   every_third);
  const TrainResult result = TrainRegression(problem, Epochs(4, 8), &rule);
  EXPECT_EQ(result.summary.num_taken_back, 4);
  // The same as if these steps had been zero.
  JudgingRule same(IsFinite, [](int k, Eigen::VectorXd* step) {
    if (k % 3 == 0) step->setZero();
  });
  const TrainResult expected = TrainRegression(problem, Epochs(4, 8), &same);
  EXPECT_EQ(result.weights, expected.weights);
  EXPECT_EQ(expected.summary.num_taken_back, 0);
  EXPECT_EQ(expected.summary.message, "epochs done");
}

// What it is told is the loss of the step's own batch, before and after.
TEST(Trainer, StepsAreJudgedByTheirOwnBatch) {
  const Regression problem;
  JudgingRule rule(IsFinite, NoChange);
  const TrainResult result = TrainRegression(problem, Epochs(1, 24), &rule);
  ASSERT_EQ(rule.after.size(), 1u);
  EXPECT_EQ(rule.before[0], result.history[0].train_loss);
  EXPECT_EQ(rule.after[0], result.history[1].train_loss);
  EXPECT_LT(rule.after[0], rule.before[0]);
}

// y = w a + b, batches of one sample with a = 0 and one with a = 1, by turns:
// the first cannot see that w has left all bounds.
struct Blind {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights = Eigen::Vector2d(0.5, 0.25);

  // `first`: the input of the first sample.
  explicit Blind(double first)
      : model(DenseNetwork({1, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::make_shared<SquaredNormLoss>(1, 1.0),
              Reduction::kMean) {
    train.inputs.resize(1, 2);
    train.inputs << first, 1.0 - first;
    train.contexts.resize(0, 2);
    train.targets = Eigen::RowVector2d(1.0, 2.0);
    test.inputs.resize(1, 0);
    test.contexts.resize(0, 0);
    test.targets.resize(1, 0);
  }

  TrainResult Train(TrainOptions options, UpdateRule* rule) const {
    options.initial_weights = weights;
    TrainResult result =
        invgrad::Train(model, {train, test}, Borrowed(rule), options);
    EXPECT_EQ(result.error, "");
    return result;
  }
};

void JumpAtStepFive(int k, Eigen::VectorXd* step) {
  if (k == 5) (*step)[0] = 1e200;
}

void JumpAtStepSix(int k, Eigen::VectorXd* step) {
  if (k == 6) (*step)[0] = 1e200;
}

TEST(Trainer, AStepAfterWhichTheNextBatchHasNoLossIsTakenBack) {
  const Blind problem(0.0);
  JudgingRule rule(IsFinite, JumpAtStepFive);
  const TrainResult result = problem.Train(Epochs(6, 1), &rule);
  EXPECT_EQ(result.summary.message, "epochs done; 1 of 12 steps taken back");
  EXPECT_EQ(result.summary.num_taken_back, 1);
  // Step 5 was judged twice.
  ASSERT_EQ(rule.after.size(), 13u);
  EXPECT_TRUE(std::isfinite(rule.after[4]));
  EXPECT_TRUE(std::isnan(rule.after[5]));
  JudgingRule same(IsFinite, [](int k, Eigen::VectorXd* step) {
    if (k == 5) step->setZero();
  });
  EXPECT_EQ(result.weights, problem.Train(Epochs(6, 1), &same).weights);
  // A rule that does not judge is left to its fate.
  ExplodingRule other(5, 1e200);
  EXPECT_EQ(problem.Train(Epochs(6, 1), &other)
                .summary.message.rfind("diverged at step 6: ", 0),
            0u);
}

// The last step of an epoch, whose next batch would have been the blind one.
TEST(Trainer, AStepAfterWhichTheTrainLossIsNotFiniteIsTakenBack) {
  const Blind problem(1.0);
  JudgingRule rule(IsFinite, JumpAtStepSix);
  const TrainResult result = problem.Train(Epochs(6, 1), &rule);
  EXPECT_EQ(result.summary.message, "epochs done; 1 of 12 steps taken back");
  for (const HistoryRow& row : result.history) {
    EXPECT_TRUE(std::isfinite(row.train_loss)) << row.step;
  }
}

// Where taking back does not help, the run has diverged.
TEST(Trainer, NothingIsTakenBackTwice) {
  Blind problem(0.0);
  problem.train.targets(0, 1) = 1e200;
  JudgingRule rule(IsFinite, NoChange);
  const TrainResult start = problem.Train(Epochs(6, 1), &rule);
  EXPECT_EQ(start.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(start.summary.message.rfind("the loss is not finite at the", 0), 0u)
      << start.summary.message;
}

// Stopped and resumed after every step, the one before the failure included.
TEST(Trainer, ARunWithStepsTakenBackGoesOnWhereItWas) {
  const Blind problem(0.0);
  const TemporaryFolder folder;
  JudgingRule whole_rule(IsFinite, JumpAtStepFive);
  const TrainResult whole = problem.Train(Epochs(4, 1), &whole_rule);
  EXPECT_EQ(whole.summary.num_taken_back, 1);
  for (const int stop : {4, 5, 6, 7}) {
    SCOPED_TRACE(stop);
    TrainOptions options = Epochs(4, 1);
    options.checkpoint_path = folder / std::to_string(stop);
    options.max_num_steps = stop;
    JudgingRule first(IsFinite, JumpAtStepFive);
    problem.Train(options, &first);
    options.max_num_steps = TrainOptions().max_num_steps;
    JudgingRule second(IsFinite, JumpAtStepFive);
    const TrainResult resumed = problem.Train(options, &second);
    EXPECT_EQ(resumed.weights, whole.weights);
    EXPECT_EQ(resumed.summary.num_taken_back, 1);
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
  }
}

// Full Gauss-Newton steps of almost twice the length on batches of four: some
// make their batch worse.
TEST(Trainer, ControlledRunsResumeBitForBit) {
  const Regression problem;
  const TemporaryFolder folder;
  const std::string text =
      "power:kappa=1:step_size=1.9:truncation=0:control=gain";
  TrainOptions options = Epochs(8, 4);
  options.shuffle = true;
  const auto whole_rule = MakeRule(text);
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());
  EXPECT_GT(whole.summary.num_taken_back, 2);
  EXPECT_LT(whole.summary.num_taken_back, 40);
  EXPECT_LT(whole.history.back().train_loss,
            0.1 * whole.history.front().train_loss);
  for (const int stop : {1, 7, 20, 33}) {
    SCOPED_TRACE(stop);
    TrainOptions stopped = options;
    stopped.checkpoint_path = folder / std::to_string(stop);
    stopped.max_num_steps = stop;
    const auto first = MakeRule(text);
    TrainRegression(problem, stopped, first.get());
    stopped.max_num_steps = options.max_num_steps;
    const auto second = MakeRule(text);
    const TrainResult resumed = TrainRegression(problem, stopped, second.get());
    EXPECT_EQ(resumed.weights, whole.weights);
    EXPECT_EQ(resumed.summary.num_taken_back, whole.summary.num_taken_back);
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
  }
}

TEST(Trainer, RefusesDataThatAreNotFinite) {
  Regression problem;
  problem.train.inputs(1, 5) = NAN;
  const std::string error = Refusal(problem, Epochs(1, 8), "adam");
  EXPECT_NE(error.find("train data"), std::string::npos) << error;
  EXPECT_NE(error.find('5'), std::string::npos) << error;
}

class StoppingCallback final : public ceres::IterationCallback {
 public:
  StoppingCallback(int step, ceres::CallbackReturnType verdict)
      : step_(step), verdict_(verdict) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    EXPECT_EQ(iteration.iteration, num_calls_++);
    return iteration.iteration == step_ ? verdict_ : ceres::SOLVER_CONTINUE;
  }

 private:
  int step_;
  ceres::CallbackReturnType verdict_;
  int num_calls_ = 0;
};

TEST(Trainer, CallbacksEndTheRunAsInCeres) {
  const Regression problem;
  for (const auto& [verdict, type] :
       {std::make_pair(ceres::SOLVER_ABORT, ceres::USER_FAILURE),
        std::make_pair(ceres::SOLVER_TERMINATE_SUCCESSFULLY,
                       ceres::USER_SUCCESS)}) {
    StoppingCallback callback(4, verdict);
    TrainOptions options = Epochs(10, 8);
    options.callbacks.push_back(&callback);
    const auto rule = MakeRule("adam");
    const TrainResult result = TrainRegression(problem, options, rule.get());
    EXPECT_EQ(result.summary.termination_type, type);
    EXPECT_EQ(result.summary.num_steps, 4);
    EXPECT_EQ(result.history.back().step, 4);
  }
}

// Stopped within an epoch of three steps (4, 5), at its end, where an
// evaluation is due (6), and before the first step (0).
TEST(Trainer, AStoppedRunGoesOnWhereItWas) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainOptions options = Epochs(5, 8);
  options.shuffle = true;
  const auto whole_rule = MakeRule("adam");
  const TrainResult whole = TrainRegression(problem, options, whole_rule.get());
  for (const int step : {0, 4, 5, 6}) {
    SCOPED_TRACE(step);
    StoppingCallback callback(step, ceres::SOLVER_TERMINATE_SUCCESSFULLY);
    TrainOptions stopped_options = options;
    stopped_options.checkpoint_path = folder / std::to_string(step);
    stopped_options.callbacks.push_back(&callback);
    const auto first_rule = MakeRule("adam");
    const TrainResult stopped =
        TrainRegression(problem, stopped_options, first_rule.get());
    EXPECT_EQ(stopped.summary.num_steps, step);
    stopped_options.callbacks.clear();
    const auto second_rule = MakeRule("adam");
    const TrainResult resumed =
        TrainRegression(problem, stopped_options, second_rule.get());
    EXPECT_EQ(resumed.weights, whole.weights);
    EXPECT_EQ(resumed.summary.num_steps, whole.summary.num_steps);
    ASSERT_EQ(resumed.history.size(), whole.history.size());
    for (size_t i = 0; i < whole.history.size(); ++i) {
      EXPECT_EQ(resumed.history[i].step, whole.history[i].step);
      EXPECT_EQ(resumed.history[i].train_loss, whole.history[i].train_loss);
    }
  }
}

TEST(Trainer, StopsAtTheTargetLossAndWhenPatienceEnds) {
  const Regression problem;
  TrainOptions options = Epochs(10000, 8);
  options.target_loss = 1e-3;
  auto rule = MakeRule("half_inverse:step_size=auto");
  TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_LE(result.history.back().train_loss, 1e-3);

  options.target_loss = 0.0;
  options.patience = 3;
  // Steps too small to change a weight: there is never a new minimum.
  rule = MakeRule("gradient_descent:step_size=1e-300");
  result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(result.summary.num_steps, 3 * 3);
}

TEST(Trainer, TimeBudgetEndsTheRun) {
  const Regression problem;
  TrainOptions options;
  options.max_time_in_seconds = 0.02;
  options.batch_size = 8;
  const auto rule = MakeRule("adam");
  const TrainResult result = TrainRegression(problem, options, rule.get());
  EXPECT_EQ(result.summary.message, "time used up");
  EXPECT_GE(result.summary.train_time_in_seconds, 0.02);
  EXPECT_GT(result.summary.num_steps, 0);
}

TEST(Trainer, EvaluationsAreDenseFirstAndLogarithmicLater) {
  for (int epoch = 1; epoch <= 40; ++epoch) {
    EXPECT_TRUE(IsEvaluationEpoch(epoch)) << epoch;
  }
  int last = 40;
  for (int epoch = 41; epoch <= 100000; ++epoch) {
    if (!IsEvaluationEpoch(epoch)) continue;
    const double growth = static_cast<double>(epoch - last) / last;
    EXPECT_LE(growth, 1.0 / 20.0 + 1e-12) << epoch;
    EXPECT_GE(growth, 1.0 / 42.0) << epoch;
    last = epoch;
  }
}

}  // namespace train_test
}  // namespace invgrad
