// Construction and checkpoint of a training run; training_run.cc has the loop.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <typeinfo>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/chain/neuron_statistics.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/method.h"
#include "invgrad/output_layer/steady_fall.h"
#include "invgrad/random.h"
#include "invgrad/train/training_run.h"

namespace invgrad {
namespace {

constexpr long kNoSteps = std::numeric_limits<long>::max();

// The number of steps of an earlier phase that ends by its budget.
long StepsOfShare(const Phase& phase, const Engine& engine) {
  long steps = kNoSteps;
  if (phase.num_epochs > 0 && !engine.epochs().has_value()) {
    steps = phase.num_epochs * engine.steps_per_epoch();
  }
  if (phase.num_steps > 0) steps = std::min<long>(steps, phase.num_steps);
  return steps;
}

// A row after the other; the last one is at `last_step` or before.
void VisitHistory(StateArchive* archive, long last_step, History* history) {
  constexpr size_t kSize = 1 + std::size(kHistoryColumns);
  Eigen::MatrixXd rows(kSize, history->size());
  for (size_t i = 0; i < history->size(); ++i) {
    const HistoryRow& row = (*history)[i];
    double* value = rows.col(i).data();
    *value++ = static_cast<double>(row.step);
    for (const HistoryColumn& column : kHistoryColumns) {
      *value++ = row.*column.value;
    }
  }
  Eigen::VectorXd values = rows.reshaped();
  archive->Visit("history", &values);
  archive->Require(values.size() > 0 && values.size() % kSize == 0, "history");
  if (!archive->is_reading() || !archive->error().empty()) return;
  rows = values.reshaped(kSize, values.size() / kSize);
  archive->Require(AreCounts(rows.row(0), static_cast<double>(last_step)),
                   "history");
  if (!archive->error().empty()) return;
  history->resize(rows.cols());
  for (size_t i = 0; i < history->size(); ++i) {
    HistoryRow& row = (*history)[i];
    const double* value = rows.col(i).data();
    row.step = static_cast<long>(*value++);
    for (const HistoryColumn& column : kHistoryColumns) {
      row.*column.value = *value++;
    }
  }
}

// Warns of inputs so large that the first layer does not learn.
void WarnOfSaturation(const Model& model,
                      const Eigen::VectorXd& weights,
                      const DataSet& train) {
  constexpr double kLarge = 10.0;
  constexpr int kMaxNumSamples = 1000;
  const DataSet samples =
      train.Range(0, std::min(kMaxNumSamples, train.num_samples()));
  const double largest =
      samples.inputs.size() > 0 ? samples.inputs.cwiseAbs().maxCoeff() : 0.0;
  if (largest <= kLarge) return;
  std::vector<NeuronStatistics> first =
      ComputeNeuronStatistics(model.network(), weights, samples);
  first.erase(
      std::remove_if(first.begin(),
                     first.end(),
                     [](const auto& neuron) { return neuron.layer > 1; }),
      first.end());
  const int num_saturated = CountSaturated(first);
  if (2 * num_saturated <= static_cast<int>(first.size())) return;
  LOG(WARNING) << fmt::format(
      "{} of {} neurons of the first layer are saturated at the initial "
      "weights: the inputs are as large as {:.2g}. Inputs of about 1 train "
      "better; InputScales (dense_network.h) standardizes them, ScaledFeatures "
      "(trial_function.h) those of an Equation",
      num_saturated,
      first.size(),
      largest);
}

// The option that is negative or not a number; empty: none is.
std::string OutOfRange(const TrainOptions& options) {
  const std::pair<const char*, double> values[] = {
      {"max_num_epochs", options.max_num_epochs},
      {"max_num_steps", static_cast<double>(options.max_num_steps)},
      {"max_time_in_seconds", options.max_time_in_seconds},
      {"target_loss", options.target_loss},
      {"patience", options.patience},
      {"memory_limit", options.memory_limit}};
  for (const auto& [name, value] : values) {
    if (!(value >= 0.0)) {
      return fmt::format("{} = {}; allowed: 0 and above", name, value);
    }
  }
  return "";
}

}  // namespace

TrainingRun::Impl::Impl(const Model& model,
                        TrainingData data,
                        TrainOptions options)
    : simulator_(std::make_shared<CountedSimulator>(model.shared_simulator())),
      model_(WithSimulator(model.WithThreads(options.num_threads), simulator_)),
      data_(std::move(data)),
      options_(std::move(options)) {
  CHECK_GT(data_.train.num_samples(), 0) << "there are no training samples";
  // A single rank is a run in one process, bit for bit.
  if (options_.communicator != nullptr && options_.communicator->size() == 1) {
    options_.communicator = nullptr;
  }
  const std::string why_no_lanes = model_.simulator().WhyNoLanes();
  if (!why_no_lanes.empty()) {
    VLOG(1) << "the samples are simulated one at a time: " << why_no_lanes;
  }
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
  CHECK_EQ(options_.initial_weights.size(), model_.num_weights())
      << "initial_weights are those of another network.";
  if (options_.batch_size < 0) {
    options_.batch_size =
        std::min(TrainOptions::kDefaultBatchSize, data_.train.num_samples());
  }
  state_.weights = options_.initial_weights;
  error_ = OutOfRange(options_);
  if (!error_.empty()) return;
  std::string where;
  if (!data_.train.IsFinite(&where)) {
    error_ = "train data: " + where;
  } else if (!data_.test.IsFinite(&where)) {
    error_ = "test data: " + where;
  } else if (!weights().allFinite()) {
    error_ = "the initial weights are not finite";
  }
}

void TrainingRun::Impl::Add(const Method& method) {
  AddPhases(method);
  AgreeWithRanks();
}

void TrainingRun::Impl::Add(const std::string& method) {
  Method parsed;
  if (error().empty() && ParseMethod(method, &parsed, &error_)) {
    AddPhases(parsed);
  }
  AgreeWithRanks();
}

void TrainingRun::Impl::Add(std::shared_ptr<UpdateRule> rule) {
  CHECK(rule != nullptr);
  if (error().empty()) {
    const UpdateRule& object = *rule;
    Method method;
    method.label = std::string("rule object of ") + typeid(object).name();
    method.phases.resize(1);
    std::string memory;
    std::unique_ptr<Engine> engine = MakeEngine(method.phases[0],
                                                std::move(rule),
                                                model_,
                                                data_,
                                                options_,
                                                &memory,
                                                &error_);
    phases_.push_back({std::move(engine), kNoSteps, memory});
    Start(method, &object);
  }
  AgreeWithRanks();
}

void TrainingRun::Impl::AddPhases(const Method& method) {
  if (!error().empty()) return;
  for (const Phase& phase : method.phases) {
    if (!AddPhase(phase, &phase == &method.last_phase())) {
      if (method.phases.size() > 1) error_ = phase.label + ": " + error_;
      return;
    }
  }
  Start(method, nullptr);
}

bool TrainingRun::Impl::AddPhase(const Phase& phase, bool is_last) {
  std::string memory;
  std::unique_ptr<Engine> engine = MakeEngine(
      phase, phase.MakeRule(), model_, data_, options_, &memory, &error_);
  if (engine == nullptr) return false;
  const long share = is_last ? kNoSteps : StepsOfShare(phase, *engine);
  phases_.push_back({std::move(engine), share, memory});
  if (!is_last && phase.num_epochs > 0) {
    phases_.back().max_num_epochs = phase.num_epochs;
  }
  if (phase.output_layer != Phase::OutputLayer::kAuto) return true;
  phases_.back().early_share = SteadyFall::kEnd;
  Phase next = phase;
  next.output_layer = Phase::OutputLayer::kTrained;
  return AddPhase(next, is_last);
}

void TrainingRun::Impl::Start(const Method& method, const UpdateRule* rule) {
  if (!error().empty()) return;
  if (!options_.checkpoint_path.empty() || options_.communicator != nullptr) {
    identity_ = IdentityOfRun(
        model_, data_.train, data_.test, data_.source.get(), method, options_);
    if (rule != nullptr && rule->Needs().progress)
      identity_.AddBudget(options_);
  }
  if (!options_.checkpoint_path.empty()) {
    std::error_code failure;
    if (std::filesystem::exists(options_.checkpoint_path, failure)) Restore();
    if (failure) error_ = options_.checkpoint_path + ": " + failure.message();
  }
  if (!error().empty()) return;
  if (history().empty() && is_first_rank()) {
    WarnOfSaturation(model_, weights(), data_.train);
  }
  LimitPhase();
  if (phase().is_trial() && state_.first_weights.size() == 0) {
    state_.first_weights = weights();
  }
}

void TrainingRun::Impl::AgreeWithRanks() {
  if (options_.communicator == nullptr) return;
  const Communicator& communicator = *options_.communicator;
  if (!communicator.Agree(error_.empty(), &error_)) return;
  const std::string difference =
      identity_.Difference(communicator.GatherTexts(identity_.text())[0]);
  if (!difference.empty()) {
    error_ = fmt::format(
        "rank {} differs from rank 0: {}", communicator.rank(), difference);
  }
  const std::string start =
      history().empty() ? "afresh" : fmt::format("at step {}", step());
  const std::string of_rank_0 = communicator.GatherTexts(start)[0];
  if (error_.empty() && start != of_rank_0) {
    error_ = fmt::format(
        "rank {} begins {}, rank 0 {}: all ranks must be able to read {}",
        communicator.rank(),
        start,
        of_rank_0,
        options_.checkpoint_path);
  }
  communicator.Agree(error_.empty(), &error_);
}

// --- Checkpoint ---

bool TrainingRun::Impl::IsCheckpointDue() const {
  const std::chrono::duration<double> since = Clock::now() - last_checkpoint_;
  return since.count() >= options_.checkpoint_interval_in_seconds;
}

StateArchive TrainingRun::Impl::Checkpoint() {
  StateArchive archive;
  if (!options_.checkpoint_path.empty() && engine().has_state()) {
    VisitState(&archive, &state_);
  }
  return archive;
}

void TrainingRun::Impl::SaveCheckpoint(const StateArchive& archive) {
  if (options_.checkpoint_path.empty() || !engine().has_state() ||
      !is_first_rank()) {
    return;
  }
  std::string error;
  // The run continues if a checkpoint cannot be written.
  if (!archive.Write(options_.checkpoint_path, identity_, &error)) {
    LOG(ERROR) << error;
  }
  last_checkpoint_ = Clock::now();
}

void TrainingRun::Impl::Restore() {
  StateArchive archive =
      StateArchive::Read(options_.checkpoint_path, identity_);
  State state = state_;
  if (archive.error().empty()) VisitState(&archive, &state);
  if (archive.error().empty()) {
    std::swap(state_, state);
    // The last step of a run may exceed its epochs.
    const double max_epoch =
        options_.max_num_epochs +
        std::max(1.0 / engine().steps_per_epoch(),
                 1.0 * engine().batch_size() / data_.train.num_samples());
    if (step() > options_.max_num_steps || epoch() >= max_epoch) {
      archive.Fail(fmt::format(
          "the run has taken {} steps, more than its budget now", step()));
      std::swap(state_, state);
    }
  }
  error_ = archive.error();
}

void TrainingRun::Impl::VisitState(StateArchive* archive, State* state) {
  archive->Visit("weights", &state->weights, model_.num_weights());
  archive->Require(state->weights.allFinite(), "weights");
  archive->Visit("phase", &state->phase);
  archive->Require(state->phase < static_cast<int>(phases_.size()), "phase");
  archive->Visit("first_step", &state->first_step);
  archive->Visit("step", &state->step);
  archive->Require(state->first_step <= state->step, "first_step");
  for (const auto& [name, value] :
       {std::pair("first_epoch", &state->first_epoch),
        std::pair("first_second", &state->first_second),
        std::pair("seconds", &state->seconds)}) {
    archive->Visit(name, value);
    archive->Require(*value >= 0.0 && std::isfinite(*value), name);
  }
  archive->Visit("simulator_calls", &state->simulator_calls);
  archive->Visit("batch_loss", &state->batch_loss);
  archive->Visit("step_norm", &state->step_norm);
  archive->Visit("best_loss", &state->best_loss);
  archive->Visit("rows_since_best", &state->rows_since_best);
  archive->Visit("best_weights", &state->best_weights);
  archive->Require(state->best_weights.size() == 0 ||
                       (state->best_weights.size() == model_.num_weights() &&
                        state->best_weights.allFinite()),
                   "best_weights");
  archive->Visit("best_train_loss", &state->best_train_loss);
  archive->Visit("best_step", &state->best_step);
  VisitHistory(archive, state->step, &state->history);
  const bool has_trial =
      std::any_of(phases_.begin(), phases_.end(), [](const RunPhase& phase) {
        return phase.is_trial();
      });
  if (has_trial) {
    archive->Visit("first_weights", &state->first_weights);
    archive->Visit("set_aside", &state->set_aside);
    archive->Visit("loss_set_aside", &state->loss_set_aside);
    for (const Eigen::VectorXd* weights :
         {&state->first_weights, &state->set_aside}) {
      archive->Require(
          weights->size() == 0 ||
              (weights->size() == model_.num_weights() && weights->allFinite()),
          "first_weights");
    }
  }
  if (!archive->error().empty()) return;
  for (int k = 0; k <= state->phase; ++k) {
    archive->set_prefix(fmt::format("phase{}.", k + 1));
    phases_[k].engine->VisitState(archive);
  }
}

}  // namespace invgrad
