// Runs that go on from their checkpoint, bit for bit.

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/core/blas_kernels.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace train_resume_test {

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
    EXPECT_EQ(resumed.history[i].simulator_calls,
              whole.history[i].simulator_calls);
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

// A run of this regression, whose checkpoint a changed one must not take.
class ACheckpoint : public ::testing::Test {
 protected:
  ACheckpoint() {
    options_.checkpoint_path = folder_ / "checkpoint";
    EXPECT_EQ(Resume(), "");
    bytes_ = Bytes();
  }

  // Why the run is refused.
  std::string Resume() {
    TrainOptions options = options_;
    options.initial_weights = problem_.weights;
    const TrainResult result = Train(
        problem_.model, {problem_.train, problem_.test}, method_, options);
    if (!result.error.empty()) {
      EXPECT_EQ(result.weights, problem_.weights);
      EXPECT_TRUE(result.history.empty());
      EXPECT_EQ(Bytes(), bytes_);  // as it was
    }
    return result.error;
  }

  std::string Bytes() const {
    std::string bytes, error;
    EXPECT_TRUE(ReadFile(options_.checkpoint_path, &bytes, &error)) << error;
    return bytes;
  }

  // With this difference from the run of the checkpoint.
  void ExpectRefused(const std::string& difference) {
    const std::string error = Resume();
    EXPECT_EQ(error.rfind(options_.checkpoint_path, 0), 0u) << error;
    EXPECT_NE(error.find("of another run: " + difference), std::string::npos)
        << error;
  }

  const TemporaryFolder folder_;
  Regression problem_;
  std::string method_ = "adam";
  TrainOptions options_ = Epochs(2, 8);
  std::string bytes_;  // of the checkpoint
};

TEST_F(ACheckpoint, OfAnotherMethodIsRefused) {
  method_ = "rmsprop";
  ExpectRefused("method: adam, now method: rmsprop");
}

TEST_F(ACheckpoint, OfAnotherBatchSizeIsRefused) {
  options_.batch_size = 6;
  ExpectRefused("batch size: 8, now batch size: 6");
}

TEST_F(ACheckpoint, OfAnotherOrderIsRefused) {
  options_.shuffle = true;
  ExpectRefused(
      "order of the samples: as given, now order of the samples: of seed 0");
}

TEST_F(ACheckpoint, OfAnotherClockIsRefused) {
  options_.cpu_time = true;
  ExpectRefused("none, now seconds: of the processor");
}

TEST_F(ACheckpoint, OfOtherTrainingDataIsRefused) {
  problem_.train.targets(1, 7) += 1e-12;
  ExpectRefused("training data: ");
}

TEST_F(ACheckpoint, OfOtherTestDataIsRefused) {
  problem_.test.inputs(0, 0) = -problem_.test.inputs(0, 0);
  ExpectRefused("test data: ");
}

TEST_F(ACheckpoint, OfOtherInitialWeightsIsRefused) {
  problem_.weights[3] = 0.0;
  ExpectRefused("initial weights: ");
}

TEST_F(ACheckpoint, OfAnotherActivationIsRefused) {
  problem_.model =
      problem_.model.WithNetwork(DenseNetwork({2, 5, 2}, Activation::kGelu));
  ExpectRefused("network: 2-5-2 tanh, now network: 2-5-2 gelu");
}

TEST_F(ACheckpoint, OfAnotherLossIsRefused) {
  problem_.model = problem_.model.WithLoss(
      std::make_shared<SquaredNormLoss>(2, 0.5), Reduction::kMean);
  ExpectRefused("simulator and loss: ");
}

TEST_F(ACheckpoint, OfOtherKernelsIsRefused) {
  const std::string kernels = "BLAS kernels: ";
  const size_t begin = bytes_.find(kernels) + kernels.size();
  bytes_.replace(begin, bytes_.find('\n', begin) - begin, "Z80");
  std::string error;
  ASSERT_TRUE(WriteFile(options_.checkpoint_path, bytes_, &error)) << error;
  ExpectRefused("BLAS kernels: Z80, now BLAS kernels: " + BlasKernels());
}

// Whatever the budget was, the run goes on with a larger one, and a run that is
// longer than its budget is no run of that budget.
TEST_F(ACheckpoint, OfALongerRunIsRefused) {
  options_.max_num_epochs = 1;
  EXPECT_NE(Resume().find("the run has taken 6 steps, more than its budget"),
            std::string::npos);
  options_.max_num_epochs = 3;
  options_.max_num_steps = 5;
  EXPECT_NE(Resume().find("the run has taken 6 steps, more than its budget"),
            std::string::npos);
  options_.max_num_steps = 6;
  EXPECT_EQ(Resume(), "");
}

TEST_F(ACheckpoint, OfAScheduleBelongsToItsBudget) {
  method_ = "adam:schedule=cosine";
  std::filesystem::remove(options_.checkpoint_path);
  EXPECT_EQ(Resume(), "");
  EXPECT_EQ(Resume(), "");
  bytes_ = Bytes();
  options_.max_num_epochs = 4;
  ExpectRefused(
      "budget of the schedule: 2 epochs, now budget of the schedule: 4 epochs");
}

// A checkpoint whose digest is right, with one array changed.
TEST_F(ACheckpoint, WithValuesThatCannotBeIsRefused) {
  const double nan = std::nan("");
  const double huge = 1e300;
  options_.shuffle = true;
  std::filesystem::remove(options_.checkpoint_path);
  EXPECT_EQ(Resume(), "");
  const std::string bytes = Bytes();
  const size_t first = bytes.find('\n') + 1;
  const size_t begin = bytes.find('\n', first) + 1;
  std::istringstream text(bytes.substr(bytes.find("\n\n") + 2));
  size_t num_arrays = 0;
  text >> num_arrays;
  std::map<std::string, size_t> position;
  size_t num_values = 0;
  for (size_t i = 0; i < num_arrays; ++i) {
    std::string name;
    size_t size = 0;
    text >> name >> size;
    position[name] = num_values;
    num_values += size;
  }
  const size_t values = bytes.size() - sizeof(double) * num_values;
  for (const auto& [name, value] : std::vector<std::pair<std::string, double>>{
           {"weights", nan},
           {"phase", 1.0},
           {"phase", -1.0},
           {"phase", nan},
           {"step", 0.5},
           {"step", -6.0},
           {"step", huge},
           {"first_step", huge},
           {"first_epoch", nan},
           {"first_second", -1.0},
           {"seconds", nan},
           {"rows_since_best", -1.0},
           {"rows_since_best", 1e10},
           {"history", nan},
           {"history", 7.0},
           {"history", -1.0},
           {"phase1.steps_of_phase", huge},
           {"phase1.steps_of_phase", nan},
           {"phase1.num_undone", -1.0},
           {"phase1.weights_before", nan},
           {"phase1.random", -1.0},
           {"phase1.random", huge}}) {
    SCOPED_TRACE(name + " " + std::to_string(value));
    ASSERT_EQ(position.count(name), 1u);
    bytes_ = bytes;
    std::memcpy(&bytes_[values + sizeof(double) * position[name]],
                &value,
                sizeof(double));
    bytes_.replace(first, 16, Digest().Add(bytes_.substr(begin)).Hex());
    std::string error;
    ASSERT_TRUE(WriteFile(options_.checkpoint_path, bytes_, &error)) << error;
    error = Resume();
    EXPECT_NE(error.find("'" + name + "' is missing or does not fit"),
              std::string::npos)
        << error;
  }
}

// Notes whether a file is there when the first step ends.
class Watch final : public ceres::IterationCallback {
 public:
  explicit Watch(std::string path) : path_(std::move(path)) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    if (iteration.iteration == 1) has_found_ = std::filesystem::exists(path_);
    return ceres::SOLVER_CONTINUE;
  }
  bool has_found() const { return has_found_; }

 private:
  const std::string path_;
  bool has_found_ = false;
};

// The evaluation before the first step may take minutes.
TEST_F(ACheckpoint, IsWrittenBeforeTheFirstStep) {
  Watch watch(options_.checkpoint_path);
  options_.callbacks = {&watch};
  options_.checkpoint_interval_in_seconds = 0.0;
  std::filesystem::remove(options_.checkpoint_path);
  EXPECT_EQ(Resume(), "");
  EXPECT_TRUE(watch.has_found());
}

TEST_F(ACheckpoint, NeedNotEndAnEpoch) {
  options_ = Epochs(3, 8);
  options_.shuffle = true;
  options_.initial_weights = problem_.weights;
  const TrainingData data{problem_.train, problem_.test};
  const TrainResult whole = Train(problem_.model, data, "adam", options_);
  options_.checkpoint_path = folder_ / "killed";
  options_.checkpoint_interval_in_seconds = 0.0;
  // Of nine steps, three an epoch; each run is abandoned, as by a kill.
  for (const int step : {1, 2, 3, 5, 8}) {
    TrainingRun run(problem_.model, data, "adam", options_);
    ASSERT_EQ(run.error(), "");
    while (run.step() < step) ASSERT_TRUE(run.Step());
  }
  TrainingRun last(problem_.model, data, "adam", options_);
  EXPECT_EQ(last.step(), 8);
  while (last.Step()) continue;
  EXPECT_EQ(last.weights(), whole.weights);
  EXPECT_EQ(last.history().back().train_loss, whole.history.back().train_loss);
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
  EXPECT_GT(whole.summary.num_undone, 2);
  EXPECT_LT(whole.summary.num_undone, 40);
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
    EXPECT_EQ(resumed.summary.num_undone, whole.summary.num_undone);
    EXPECT_EQ(resumed.summary.message, whole.summary.message);
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
    StopAt callback(step);
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

// Samples that depend on the step, each set of which serves three.
class ThreeSteps final : public DataSource {
 public:
  DataSet Batch(long step,
                int batch_size,
                const Model& /*model*/,
                const Eigen::VectorXd& /*weights*/) const override {
    NumpyRandom random(static_cast<std::uint32_t>(step));
    return Regression::MakeData(batch_size, &random);
  }
  long steps_per_set() const override { return 3; }
  std::string Name() const override { return "three steps"; }
};

// The run stops in the middle of a set.
TEST(Trainer, AResumedSetHasTheSamplesOfItsFirstStep) {
  const Regression problem;
  const TemporaryFolder folder;
  TrainingData data{problem.train, problem.test};
  data.source = std::make_shared<ThreeSteps>();
  TrainOptions options;
  options.batch_size = 8;
  options.initial_weights = problem.weights;
  options.max_num_steps = 8;
  const TrainResult whole = Train(problem.model, data, "adam", options);
  options.checkpoint_path = folder / "checkpoint";
  options.max_num_steps = 4;
  Train(problem.model, data, "adam", options);
  options.max_num_steps = 8;
  const TrainResult resumed = Train(problem.model, data, "adam", options);
  ASSERT_EQ(resumed.error, "");
  EXPECT_EQ(resumed.summary.num_steps, 8);
  EXPECT_EQ(resumed.weights, whole.weights);
}

}  // namespace train_resume_test
}  // namespace invgrad
