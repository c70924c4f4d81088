// Construction and checkpoint of a training run; train.cc has the loop.

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/engine.h"
#include "invgrad/train/train.h"

namespace invgrad {
namespace {

constexpr long kNoSteps = std::numeric_limits<long>::max();

// The number of steps of an earlier phase that ends by its budget.
long StepsOfShare(const Phase& phase, long steps_per_epoch) {
  long steps = kNoSteps;
  if (phase.num_epochs > 0) steps = phase.num_epochs * steps_per_epoch;
  if (phase.num_steps > 0) steps = std::min<long>(steps, phase.num_steps);
  return steps;
}

}  // namespace

TrainingData::TrainingData(Eigen::MatrixXd inputs, Eigen::MatrixXd targets) {
  CHECK_EQ(inputs.cols(), targets.cols()) << "one column a sample";
  train.contexts.resize(0, inputs.cols());
  train.solutions.resize(0, inputs.cols());
  train.inputs = std::move(inputs);
  train.targets = std::move(targets);
}

TrainingData::TrainingData(DataSet train, DataSet test)
    : train(std::move(train)), test(std::move(test)) {}

TrainingRun::TrainingRun(Model model, TrainingData data, TrainOptions options)
    : model_(std::move(model)),
      data_(std::move(data)),
      options_(std::move(options)) {
  CHECK_GT(data_.train.num_samples(), 0) << "there are no training samples";
  const TrainOptions none;
  if (options_.max_num_epochs == none.max_num_epochs &&
      options_.max_num_steps == none.max_num_steps &&
      options_.max_time_in_seconds == none.max_time_in_seconds) {
    options_.max_num_epochs = TrainOptions::kDefaultNumEpochs;
  }
  if (options_.initial_weights.size() == 0) {
    NumpyRandom random(options_.seed);
    options_.initial_weights = model_.network().InitialWeights(
        Initialization::kGlorotUniform, &random);
  }
  CHECK_EQ(options_.initial_weights.size(), model_.num_weights());
  weights_ = options_.initial_weights;
  std::string where;
  if (!data_.train.IsFinite(&where)) {
    error_ = "train data: " + where;
  } else if (!data_.test.IsFinite(&where)) {
    error_ = "test data: " + where;
  } else if (!weights_.allFinite()) {
    error_ = "the initial weights are not finite";
  }
}

TrainingRun::TrainingRun(Model model,
                         TrainingData data,
                         const Method& method,
                         TrainOptions options)
    : TrainingRun(std::move(model), std::move(data), std::move(options)) {
  AddPhases(method);
}

TrainingRun::TrainingRun(Model model,
                         TrainingData data,
                         const std::string& method,
                         TrainOptions options)
    : TrainingRun(std::move(model), std::move(data), std::move(options)) {
  Method parsed;
  if (error().empty() && ParseMethod(method, &parsed, &error_)) {
    AddPhases(parsed);
  }
}

TrainingRun::TrainingRun(Model model,
                         TrainingData data,
                         std::shared_ptr<UpdateRule> rule,
                         TrainOptions options)
    : TrainingRun(std::move(model), std::move(data), std::move(options)) {
  CHECK(rule != nullptr);
  if (!error().empty()) return;
  phases_.push_back(
      {MakeEngine(Phase(), std::move(rule), model_, data_, options_, &error_),
       kNoSteps});
  Start();
}

TrainingRun::~TrainingRun() = default;

void TrainingRun::AddPhases(const Method& method) {
  if (!error().empty()) return;
  for (const Phase& phase : method.phases) {
    std::unique_ptr<Engine> engine =
        MakeEngine(phase, phase.MakeRule(), model_, data_, options_, &error_);
    if (engine == nullptr) {
      if (method.phases.size() > 1) error_ = phase.label + ": " + error_;
      return;
    }
    const long share = &phase == &method.last_phase()
                           ? kNoSteps
                           : StepsOfShare(phase, engine->steps_per_epoch());
    phases_.push_back({std::move(engine), share});
  }
  Start();
}

void TrainingRun::Start() {
  if (!error().empty()) return;
  if (!options_.checkpoint_path.empty() &&
      std::filesystem::exists(options_.checkpoint_path)) {
    Restore();
  }
  if (error().empty()) LimitPhase();
}

// --- Checkpoint ---

void TrainingRun::SaveCheckpoint() {
  if (options_.checkpoint_path.empty() || !engine().has_state()) return;
  StateArchive archive;
  VisitState(&archive);
  std::string error;
  // The run continues if a checkpoint cannot be written.
  if (!archive.Write(options_.checkpoint_path, &error)) LOG(ERROR) << error;
  last_checkpoint_ = Clock::now();
}

void TrainingRun::Restore() {
  StateArchive archive = StateArchive::Read(options_.checkpoint_path);
  if (archive.error().empty()) VisitState(&archive);
  error_ = archive.error();
  if (error_.empty()) return;
  weights_ = options_.initial_weights;
  history_.clear();
}

void TrainingRun::VisitState(StateArchive* archive) {
  archive->Expect("num_phases", static_cast<long>(phases_.size()));
  archive->Visit("weights", &weights_, model_.num_weights());
  archive->Visit("phase", &phase_);
  archive->Require(phase_ >= 0 && phase_ < static_cast<int>(phases_.size()),
                   "phase");
  if (!archive->error().empty()) return;
  archive->Visit("first_step", &first_step_);
  archive->Visit("first_epoch", &first_epoch_);
  archive->Visit("first_second", &first_second_);
  archive->Visit("step", &step_);
  archive->Visit("seconds", &seconds_);
  archive->Visit("batch_loss", &batch_loss_);
  archive->Visit("step_norm", &step_norm_);
  archive->Visit("best_loss", &best_loss_);
  archive->Visit("rows_since_best", &rows_since_best_);
  VisitHistory(archive);
  for (int k = 0; k <= phase_; ++k) {
    archive->set_prefix(fmt::format("phase{}.", k + 1));
    phases_[k].engine->VisitState(archive);
  }
}

void TrainingRun::VisitHistory(StateArchive* archive) {
  constexpr size_t kSize = 1 + std::size(kHistoryColumns);
  Eigen::VectorXd rows(kSize * history_.size());
  double* value = rows.data();
  for (const HistoryRow& row : history_) {
    *value++ = static_cast<double>(row.step);
    for (const HistoryColumn& column : kHistoryColumns) {
      *value++ = row.*column.value;
    }
  }
  archive->Visit("history", &rows);
  archive->Require(rows.size() > 0 && rows.size() % kSize == 0, "history");
  if (!archive->is_reading() || !archive->error().empty()) return;
  history_.resize(rows.size() / kSize);
  value = rows.data();
  for (HistoryRow& row : history_) {
    row.step = static_cast<long>(*value++);
    for (const HistoryColumn& column : kHistoryColumns) {
      row.*column.value = *value++;
    }
  }
}

}  // namespace invgrad
