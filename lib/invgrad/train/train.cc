#include "invgrad/train/train.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/evaluation.h"
#include "invgrad/train/make_engine.h"

namespace invgrad {
namespace {

std::string AtStep(const std::string& what, long step) {
  return fmt::format("{} at step {}", what, step);
}

// Returns an error message if the values of the input are invalid, otherwise an
// empty string.
std::string CheckValues(const TrainingData& data,
                        const Eigen::VectorXd& weights) {
  std::string where;
  if (!data.train.IsFinite(&where)) return "train data: " + where;
  if (!data.test.IsFinite(&where)) return "test data: " + where;
  if (!weights.allFinite()) return "the initial weights are not finite";
  return "";
}

// The number of steps of an earlier phase that ends by its budget.
long StepsOfShare(const Phase& phase, long steps_per_epoch) {
  long steps = Budget::kNoSteps;
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
      options_(std::move(options)),
      budget_{options_.max_num_epochs,
              options_.max_num_steps,
              options_.max_time_in_seconds},
      recorder_(&model_, &data_.test, options_.metric) {
  CHECK_GT(data_.train.num_samples(), 0) << "there are no training samples";
  if (!budget_.is_finite()) {
    budget_.max_num_epochs = TrainOptions::kDefaultNumEpochs;
  }
  if (options_.initial_weights.size() == 0) {
    NumpyRandom random(options_.seed);
    options_.initial_weights = model_.network().InitialWeights(
        Initialization::kGlorotUniform, &random);
  }
  CHECK_EQ(options_.initial_weights.size(), model_.num_weights());
  weights_ = options_.initial_weights;
  error_ = CheckValues(data_, weights_);
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
  std::string why;
  if (ParseMethod(method, &parsed, &why)) {
    AddPhases(parsed);
  } else {
    error_ = why;
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
      {MakeEngine(std::move(rule), model_, data_, options_, &error_),
       Budget::kNoSteps});
  Start();
}

TrainingRun::~TrainingRun() = default;

void TrainingRun::AddPhases(const Method& method) {
  if (!error().empty()) return;
  for (const Phase& phase : method.phases) {
    std::unique_ptr<Engine> engine =
        MakeEngine(phase, model_, data_, options_, weights_, &error_);
    if (engine == nullptr) {
      if (method.phases.size() > 1) {
        error_ = phase.label + ": " + error_;
      }
      return;
    }
    const long share = &phase == &method.last_phase()
                           ? Budget::kNoSteps
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

// --- The loop ---

bool TrainingRun::Step() {
  if (!error().empty() || has_ended_) return false;
  if (!has_begun_) Begin();
  return IsRunning() && TakeStep();
}

void TrainingRun::Stop() {
  if (!error().empty() || has_ended_) return;
  if (!has_begun_) Begin();
  if (!has_ended_)
    End(ceres::USER_SUCCESS, AtStep("stopped", steps_of_phase()));
}

void TrainingRun::Begin() {
  has_begun_ = true;
  // A resumed run already has the evaluation before its first step; another
  // evaluation may be due.
  if (!history().empty()) {
    EvaluateIfDue();
    return;
  }
  Evaluate();
  ceres::IterationSummary start;
  start.step_is_valid = true;
  start.step_is_successful = true;
  start.cost = history().back().train_loss;
  if (CallBack(start)) CheckStartOfPhase();
}

void TrainingRun::CheckStartOfPhase() {
  if (std::isfinite(history().back().train_loss)) return;
  double ignored = 0.0;
  std::string why;
  model_.Cost(weights(), data_.train, &ignored, &why);
  End(ceres::FAILURE, "the loss is not finite at the initial weights: " + why);
}

bool TrainingRun::IsRunning() {
  while (!has_ended_) {
    const HistoryRow& last = history().back();
    if (options_.target_loss > 0.0 && last.step == step_ &&
        last.train_loss <= options_.target_loss) {
      End(ceres::CONVERGENCE, AtStep("target loss reached", steps_of_phase()));
    } else if (options_.patience > 0 &&
               recorder_.rows_since_best() >= options_.patience) {
      End(ceres::CONVERGENCE,
          fmt::format("no improvement in {} evaluations", options_.patience));
    } else if (!budget_.Spent(position()).empty()) {
      End(ceres::NO_CONVERGENCE, budget_.Spent(position()));
    } else if (steps_of_phase() < max_num_steps_ ||
               phase_ + 1 == static_cast<int>(phases_.size())) {
      return true;
    } else {
      BeginNextPhase();
    }
  }
  return false;
}

void TrainingRun::BeginNextPhase() {
  if (last_evaluation() != step_) Evaluate();
  if (!phases_[phase_ + 1].engine->has_state()) SaveCheckpoint();
  start_ = position();
  ++phase_;
  LimitPhase();
  recorder_.BeginPhase();
  CheckStartOfPhase();
}

void TrainingRun::LimitPhase() {
  max_num_steps_ =
      std::min(phases_[phase_].max_num_steps,
               budget_.NumStepsFrom(start_, engine().steps_per_epoch()));
}

bool TrainingRun::TakeStep() {
  const Clock::time_point start = Clock::now();
  const double budget_in_seconds = budget_.max_time_in_seconds - start_.seconds;
  const double spent =
      std::max(static_cast<double>(steps_of_phase()) /
                   static_cast<double>(max_num_steps_),
               (seconds_ - start_.seconds) / budget_in_seconds);
  const Engine::StepResult result =
      engine().Step(std::min(1.0, spent), &weights_);
  seconds_ += std::chrono::duration<double>(Clock::now() - start).count();
  if (!std::isnan(result.batch_loss)) batch_loss_ = result.batch_loss;
  using Outcome = Engine::StepResult::Outcome;
  if (result.outcome == Outcome::kFailed) {
    End(ceres::FAILURE,
        AtStep("diverged", steps_of_phase() + 1) + ": " + result.message);
    return false;
  }
  if (result.outcome == Outcome::kEnded) {
    End(result.termination_type, result.message);
    return false;
  }
  ++step_;
  step_norm_ = result.iteration.step_norm;
  if (CallBack(result.iteration)) EvaluateIfDue();
  return true;
}

bool TrainingRun::CallBack(ceres::IterationSummary iteration) {
  iteration.iteration = static_cast<int>(step_);
  iteration.cumulative_time_in_seconds = seconds_;
  for (ceres::IterationCallback* callback : options_.callbacks) {
    switch ((*callback)(iteration)) {
      case ceres::SOLVER_CONTINUE:
        break;
      case ceres::SOLVER_ABORT:
        End(ceres::USER_FAILURE,
            AtStep("aborted by a callback", steps_of_phase()));
        return false;
      case ceres::SOLVER_TERMINATE_SUCCESSFULLY:
        End(ceres::USER_SUCCESS,
            AtStep("stopped by a callback", steps_of_phase()));
        return false;
    }
  }
  return true;
}

void TrainingRun::EvaluateIfDue() {
  const long steps_per_epoch = engine().steps_per_epoch();
  const bool is_due = steps_of_phase() % steps_per_epoch == 0 &&
                      IsEvaluationEpoch(steps_of_phase() / steps_per_epoch) &&
                      last_evaluation() != step_;
  if (is_due) Evaluate();
  if (is_due && !std::isfinite(history().back().train_loss)) {
    engine().RestoreLastGood(&weights_);
    End(ceres::FAILURE,
        AtStep("diverged", steps_of_phase()) +
            ": the train loss is not finite");
  } else if (std::chrono::duration<double>(Clock::now() - last_checkpoint_)
                 .count() >= options_.checkpoint_interval_in_seconds) {
    SaveCheckpoint();
  }
}

void TrainingRun::Evaluate() {
  HistoryRow row;
  row.step = step_;
  row.epoch = epoch();
  row.seconds = seconds_;
  row.batch_loss = batch_loss_;
  row.step_norm = step_norm_;
  row.train_loss = MeanLoss(model_, weights(), data_.train);
  if (!std::isfinite(row.train_loss) && engine().TakeBack(&weights_)) {
    row.train_loss = MeanLoss(model_, weights(), data_.train);
  }
  recorder_.Record(weights(), engine().counts(), row);
  if (options_.on_evaluation) options_.on_evaluation(weights(), history());
}

void TrainingRun::End(ceres::TerminationType type, const std::string& message) {
  has_ended_ = true;
  TrainSummary& summary = summary_;
  summary.termination_type = type;
  summary.message = message;
  if (phases_.size() > 1 && message != budget_.Spent(position())) {
    summary.message = fmt::format("phase {}: {}", phase_ + 1, message);
  }
  std::string reports;
  for (int k = 0; k <= phase_; ++k) reports += phases_[k].engine->Finish();
  // Written before the evaluation below, which a longer run would not make.
  if (type != ceres::FAILURE && type != ceres::CONVERGENCE) SaveCheckpoint();
  // Records the final state of the run.
  if (last_evaluation() != step_) Evaluate();
  summary.num_steps = step_;
  summary.train_time_in_seconds = seconds_;
  for (int k = 0; k <= phase_; ++k) {
    summary.num_updates += phases_[k].engine->num_updates();
    summary.num_taken_back += phases_[k].engine->num_taken_back();
  }
  if (summary.num_taken_back > 0) {
    summary.message += fmt::format("; {} of {} steps taken back",
                                   summary.num_taken_back,
                                   summary.num_updates);
  }
  summary.message += reports;
}

double TrainingRun::epoch() const {
  if (!error().empty()) return 0.0;
  return start_.epoch +
         static_cast<double>(steps_of_phase()) / engine().steps_per_epoch();
}

// --- Checkpoint ---

void TrainingRun::SaveCheckpoint() {
  if (options_.checkpoint_path.empty() || !engine().has_state()) return;
  Checkpoint checkpoint;
  StateArchive archive(StateArchive::Mode::kWrite, &checkpoint);
  VisitState(&archive);
  std::string error;
  // The run continues if a checkpoint cannot be written.
  if (!WriteCheckpoint(options_.checkpoint_path, checkpoint, &error)) {
    LOG(ERROR) << error;
  }
  last_checkpoint_ = Clock::now();
}

void TrainingRun::Restore() {
  Checkpoint checkpoint;
  if (ReadCheckpoint(options_.checkpoint_path, &checkpoint, &error_)) {
    StateArchive archive(StateArchive::Mode::kRead, &checkpoint);
    VisitState(&archive);
    if (archive.error().empty()) return;
    error_ = options_.checkpoint_path + ": " + archive.error();
  }
  weights_ = options_.initial_weights;
  recorder_.Clear();
}

void TrainingRun::VisitState(StateArchive* archive) {
  archive->Expect("num_phases", static_cast<long>(phases_.size()));
  archive->Visit("weights", &weights_, model_.num_weights());
  archive->Visit("phase", &phase_);
  archive->Require(phase_ >= 0 && phase_ < static_cast<int>(phases_.size()),
                   "phase");
  if (!archive->error().empty()) return;
  archive->Visit("first_step", &start_.step);
  archive->Visit("first_epoch", &start_.epoch);
  archive->Visit("first_second", &start_.seconds);
  archive->Visit("step", &step_);
  archive->Visit("seconds", &seconds_);
  archive->Visit("batch_loss", &batch_loss_);
  archive->Visit("step_norm", &step_norm_);
  recorder_.VisitState(archive);
  for (int k = 0; k <= phase_; ++k) {
    archive->set_prefix(fmt::format("phase{}.", k + 1));
    phases_[k].engine->VisitState(archive);
  }
}

TrainResult TrainingRun::result() const {
  return {error(), weights(), history(), summary_};
}

}  // namespace invgrad
