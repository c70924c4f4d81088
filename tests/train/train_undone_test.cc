// Steps that have no loss, or that their rule judges and undoes.

#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/option_set.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "invgrad/update_rule.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace train_undone_test {

// Steps that are fine until `bad_step`, which is `value` everywhere.
class ExplodingRule final : public UpdateRule {
 public:
  ExplodingRule(int bad_step, double value)
      : bad_step_(bad_step), value_(value) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
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

// The same, by a rule that could evaluate the loss at other points.
class ExplodingJudge final : public UpdateRule {
 public:
  struct Options {
    int bad_step = 1;
    void Describe(OptionSet* set) {
      set->Add("bad_step", &bad_step, {1, 1000000}, "whose loss is not finite");
    }
  };
  explicit ExplodingJudge(const Options& options)
      : rule_(options.bad_step, 1e200) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts = rule_.Needs();
    parts.after = true;
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    return rule_.ComputeStep(at_x, step, error);
  }

 private:
  ExplodingRule rule_;
};

// Batches without a finite loss are left out until the next evaluation, which
// goes back. In a race the bad step may be that of any slice.
TEST(Trainer, ARuleThatEvaluatesTheLossGoesBackToTheBestWeights) {
  RegisterRule<ExplodingJudge>("exploding_judge", "step = -gradient / 100");
  const Regression problem;
  for (const std::string batches : {"8", "auto"}) {
    for (int bad_step = 5; bad_step < 60; ++bad_step) {
      SCOPED_TRACE(fmt::format("batch_size={}, step {}", batches, bad_step));
      TrainOptions options = Epochs(40, 8);
      options.initial_weights = problem.weights;
      const TrainResult result = Train(
          problem.model,
          {problem.train, problem.test},
          fmt::format(
              "exploding_judge:bad_step={}:batch_size={}", bad_step, batches),
          options);
      ASSERT_EQ(result.error, "");
      EXPECT_EQ(result.summary.termination_type, ceres::NO_CONVERGENCE)
          << result.summary.message;
      EXPECT_LT(result.history.back().train_loss,
                result.history.front().train_loss);
      EXPECT_EQ(MeanLoss(problem.model, result.weights, problem.train),
                result.history.back().train_loss);
      if (batches == "8") {
        EXPECT_EQ(result.summary.num_undone, 1);
      }
    }
  }
}

// w a + b in front of the functor.
template <typename Functor>
Model ModelOf() {
  return Model(DenseNetwork({1, 1}, Activation::kTanh),
               std::make_shared<AutoDiffSimulator<Functor, 1, 1>>(),
               std::make_shared<SquaredNormLoss>(1, 1.0),
               Reduction::kMean);
}

DataSet Samples(const Eigen::RowVectorXd& inputs) {
  DataSet samples;
  samples.inputs = inputs;
  samples.contexts.resize(0, inputs.size());
  samples.targets = Eigen::MatrixXd::Ones(1, inputs.size());
  return samples;
}

struct Root {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sqrt;
    y[0] = sqrt(x[0]);
    return true;
  }
};

// After an epoch of batches without a derivative there is nothing left to try.
TEST(Trainer, ARunWithoutAnyDerivativeFails) {
  const Model model = ModelOf<Root>();
  const DataSet train = Samples(Eigen::RowVectorXd::Random(6));
  TrainOptions options = Epochs(10, 2);
  options.initial_weights = Eigen::VectorXd::Zero(2);
  for (const auto& [rule, start] :
       {std::pair("geodesic", "diverged at step 4: "),
        {"ssbroyden", "diverged at step 4: "},
        {"ceres_lm", ""},
        {"ceres_lbfgs", ""}}) {
    const TrainResult result = Train(model, {train, DataSet()}, rule, options);
    const std::string& message = result.summary.message;
    EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
    EXPECT_EQ(message.rfind(start, 0), 0u) << message;
    EXPECT_NE(message.find("its derivative is not"), std::string::npos)
        << rule << ": " << message;
  }
}

struct Thrower {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    if (!std::is_same_v<T, double>) throw std::runtime_error("no derivative");
    y[0] = x[0];
    return true;
  }
};

// Also from the threads that evaluate samples, and from that of Ceres.
TEST(Trainer, ExceptionsOfASimulatorReachTheCaller) {
  const Model model = ModelOf<Thrower>();
  const DataSet train = Samples(Eigen::RowVectorXd::Random(64));
  for (const char* rule : {"adam", "adaptive", "ceres_lm"}) {
    for (const int num_threads : {1, 2}) {
      TrainOptions options = Epochs(2, 64);
      options.num_threads = num_threads;
      EXPECT_THROW(Train(model, {train, DataSet()}, rule, options),
                   std::runtime_error)
          << rule;
    }
  }
}

// The first batch has no derivative: sqrt(0) at an input of zero. The steps on
// the others move the root away.
TEST(Trainer, CountsBatchesThatAreLeftOut) {
  const Model model = ModelOf<Root>();
  DataSet train = Samples(Eigen::RowVectorXd::LinSpaced(6, 0.5, 1.0));
  train.inputs(0) = 0.0;
  TrainOptions options = Epochs(4, 2);
  options.initial_weights = Eigen::Vector2d(1.0, 0.0);
  const TrainResult result =
      Train(model, {train, DataSet()}, "geodesic", options);
  EXPECT_NE(result.summary.message.find("; 1 of 12 batches left out"),
            std::string::npos)
      << result.summary.message;
}

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

// The last step of a budget, within an epoch: no other step meets its weights.
TEST(Trainer, DivergenceAtTheLastStepIsADivergence) {
  const Regression problem;
  const TemporaryFolder folder;
  ExplodingRule rule(5, 1e200);
  TrainOptions options;
  options.batch_size = 8;
  options.max_num_steps = 5;
  options.checkpoint_path = folder / "checkpoint";
  const TrainResult result = TrainRegression(problem, options, &rule);
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(result.summary.message.rfind(
                "diverged at step 5: the train loss is not finite", 0),
            0u)
      << result.summary.message;
  EXPECT_FALSE(std::filesystem::exists(options.checkpoint_path));
  options.max_num_steps = 4;
  ExplodingRule same(100, 0.0);
  EXPECT_EQ(result.weights, TrainRegression(problem, options, &same).weights);
}

TEST(Trainer, DivergenceAtTheEndOfAPhaseIsOfThatPhase) {
  const Regression problem;
  TrainOptions options = Epochs(2, 8);
  options.initial_weights = problem.weights;
  const TrainResult result =
      Train(problem.model,
            {problem.train, problem.test},
            "gradient_descent:step_size=1e200:steps=1>adam",
            options);
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(result.summary.message.rfind(
                "phase 1: diverged at step 1: the train loss is not finite", 0),
            0u)
      << result.summary.message;
  EXPECT_EQ(result.weights, problem.weights);
}

// Gradient descent that judges its steps as it is told to, and remembers what
// it was asked.
class JudgingRule final : public UpdateRule, public StepJudge {
 public:
  using Judgement = std::function<bool(double before, double after)>;
  using Step = std::function<void(int k, Eigen::VectorXd* step)>;
  JudgingRule(Judgement judgement, Step step)
      : judgement_(std::move(judgement)), step_(std::move(step)) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    before.push_back(at_x.cost);
    *step = -0.1 * at_x.gradient;
    step_(static_cast<int>(++num_steps_[0]), step);
    return true;
  }
  StepJudge* judge() override { return this; }
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
  EXPECT_EQ(result.summary.num_undone, 15);
  EXPECT_EQ(result.summary.num_updates, 15);
  EXPECT_EQ(result.summary.message, "epochs done; 15 of 15 steps undone");
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
  EXPECT_EQ(result.summary.num_undone, 4);
  // The same as if these steps had been zero.
  JudgingRule same(IsFinite, [](int k, Eigen::VectorXd* step) {
    if (k % 3 == 0) step->setZero();
  });
  const TrainResult expected = TrainRegression(problem, Epochs(4, 8), &same);
  EXPECT_EQ(result.weights, expected.weights);
  EXPECT_EQ(expected.summary.num_undone, 0);
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
  EXPECT_EQ(result.summary.message, "epochs done; 1 of 12 steps undone");
  EXPECT_EQ(result.summary.num_undone, 1);
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
  EXPECT_EQ(result.summary.message, "epochs done; 1 of 12 steps undone");
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

// Step 5 leads to weights that the next batch cannot judge: it has a finite loss
// there, all samples together have none.
class BlindJump final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -0.1 * at_x.gradient;
    JumpAtStepFive(++num_steps_, step);
    return true;
  }

 private:
  int num_steps_ = 0;
};

TEST(Trainer, AfterADivergenceTheBestEvaluatedWeightsAreKept) {
  const Blind problem(1.0);
  BlindJump rule;
  const TrainResult result = problem.Train(Epochs(6, 1), &rule);
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_NE(result.summary.message.find(
                "; final weights are the best that were evaluated, of step 4 "
                "(train loss "),
            std::string::npos)
      << result.summary.message;
  TrainOptions four_steps = Epochs(6, 1);
  four_steps.max_num_steps = 4;
  BlindJump same;
  EXPECT_EQ(result.weights, problem.Train(four_steps, &same).weights);
}

TEST(Trainer, ARuleThatJudgesGoesBackToTheBestEvaluatedWeights) {
  const Blind problem(1.0);
  const TemporaryFolder folder;
  const auto keeps_all = [](double, double) { return true; };
  JudgingRule rule(keeps_all, JumpAtStepFive);
  const TrainResult result = problem.Train(Epochs(6, 1), &rule);
  EXPECT_EQ(result.summary.message, "epochs done; 2 of 12 steps undone");
  for (const HistoryRow& row : result.history) {
    EXPECT_TRUE(std::isfinite(row.train_loss)) << row.step;
  }
  // The same where the run is interrupted before.
  for (const int stop : {4, 5}) {
    TrainOptions options = Epochs(6, 1);
    options.checkpoint_path = folder / std::to_string(stop);
    options.max_num_steps = stop;
    JudgingRule first(keeps_all, JumpAtStepFive);
    problem.Train(options, &first);
    options.max_num_steps = TrainOptions().max_num_steps;
    JudgingRule second(keeps_all, JumpAtStepFive);
    EXPECT_EQ(problem.Train(options, &second).weights, result.weights) << stop;
  }
}

// Stopped and resumed after every step, the one before the failure included.
TEST(Trainer, ARunWithStepsTakenBackGoesOnWhereItWas) {
  const Blind problem(0.0);
  const TemporaryFolder folder;
  JudgingRule whole_rule(IsFinite, JumpAtStepFive);
  const TrainResult whole = problem.Train(Epochs(4, 1), &whole_rule);
  EXPECT_EQ(whole.summary.num_undone, 1);
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
    EXPECT_EQ(resumed.summary.num_undone, 1);
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
  }
}

// y = x + sqrt((c x)^2): no derivative for c = 0.
struct Kink {
  template <typename T>
  bool operator()(const T* x, const double* c, T* y) const {
    using std::sqrt;
    y[0] = x[0] + sqrt(c[0] * c[0] * x[0] * x[0]);
    return true;
  }
};

// The message at the end of two epochs of two batches, each of one sample.
std::string MessageWithKinks(const std::string& method, double c0, double c1) {
  DataSet data;
  data.inputs = data.targets = Eigen::RowVector2d(1.0, 2.0);
  data.contexts = Eigen::RowVector2d(c0, c1);
  TrainOptions options = Epochs(2, 1);
  options.initial_weights = Eigen::Vector2d(0.5, 0.25);
  const TrainResult result =
      Train(Model(DenseNetwork({1, 1}, Activation::kTanh),
                  std::make_shared<AutoDiffSimulator<Kink, 1, 1, 1>>(),
                  std::make_shared<SquaredNormLoss>(1, 1.0),
                  Reduction::kMean),
            data,
            method,
            options);
  EXPECT_EQ(result.error, "");
  return result.summary.message;
}

// A rule that has judged its steps leaves the batch out.
TEST(Trainer, ABatchWithoutADerivativeEndsTheRunWithThisReason) {
  const std::string message = MessageWithKinks("adam", 0.0, 1.0);
  EXPECT_EQ(message.rfind("diverged at step 1: sample 0: the simulator's value "
                          "is finite, its derivative is not",
                          0),
            0u)
      << message;
  EXPECT_EQ(MessageWithKinks("adam", 1.0, 0.0).rfind("diverged at step 2", 0),
            0u);
  for (const double first : {0.0, 1.0}) {
    EXPECT_EQ(MessageWithKinks("geodesic", first, 1.0 - first),
              "epochs done; 2 of 4 batches left out, for which there was no "
              "finite loss or derivative");
  }
}

}  // namespace train_undone_test
}  // namespace invgrad
