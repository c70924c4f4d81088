#include "invgrad/train/train.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/train/engine.h"

namespace invgrad {
namespace {

std::string AtStep(const std::string& what, long step) {
  return fmt::format("{} at step {}", what, step);
}

// Unknown if no sample was inverted.
void FillCounts(const PullBackCounts& counts, HistoryRow* row) {
  if (counts.of(PullBackSource::kDerivative) > 0) return;
  const auto count = [&](PullBackSource source) {
    return static_cast<double>(counts.of(source));
  };
  row->by_inverse = count(PullBackSource::kInverse);
  row->by_numerical_inverse = count(PullBackSource::kNumericalInverse);
  row->by_inverse_gradient = count(PullBackSource::kInverseGradient);
  row->by_gradient = count(PullBackSource::kGradient);
  row->not_moved = count(PullBackSource::kNone);
}

}  // namespace

double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data) {
  double cost = 0.0;
  std::string ignored;
  if (!model.Cost(weights, data, &cost, &ignored)) return HistoryRow::kNone;
  const int num_samples = data.num_samples();
  return cost / (model.BatchScale(num_samples) * num_samples);
}

bool IsEvaluationEpoch(long epoch) {
  // Spacing 1 up to 40, 2 up to 80, 4 up to 160, ...
  long spacing = 1;
  while (epoch > 40 * spacing) spacing *= 2;
  return epoch % spacing == 0;
}

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
    } else if (options_.patience > 0 && rows_since_best_ >= options_.patience) {
      End(ceres::CONVERGENCE,
          fmt::format("no improvement in {} evaluations", options_.patience));
    } else if (!BudgetSpent().empty()) {
      End(ceres::NO_CONVERGENCE, BudgetSpent());
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
  first_epoch_ = epoch();
  first_step_ = step_;
  first_second_ = seconds_;
  ++phase_;
  LimitPhase();
  best_loss_ = WatchedLoss();
  rows_since_best_ = 0;
  CheckStartOfPhase();
}

void TrainingRun::LimitPhase() {
  max_num_steps_ = phases_[phase_].max_num_steps;
  if (options_.max_num_steps < std::numeric_limits<long>::max()) {
    max_num_steps_ =
        std::min(max_num_steps_, options_.max_num_steps - first_step_);
  }
  if (options_.max_num_epochs < TrainOptions().max_num_epochs) {
    // A step within an epoch may reach the budget.
    const double steps = EpochsLeft(first_epoch_) *
                         static_cast<double>(engine().steps_per_epoch());
    max_num_steps_ =
        std::min(max_num_steps_, static_cast<long>(std::ceil(steps)));
  }
}

bool TrainingRun::TakeStep() {
  const Clock::time_point start = Clock::now();
  const double budget_in_seconds = options_.max_time_in_seconds - first_second_;
  const double spent = std::max(static_cast<double>(steps_of_phase()) /
                                    static_cast<double>(max_num_steps_),
                                (seconds_ - first_second_) / budget_in_seconds);
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
  if (data_.test.num_samples() > 0) {
    row.test_loss = MeanLoss(model_, weights(), data_.test);
  }
  if (options_.metric) row.metric = options_.metric(weights());
  if (engine().counts() != nullptr) FillCounts(*engine().counts(), &row);
  history_.push_back(row);
  ++rows_since_best_;
  if (WatchedLoss() < best_loss_) {
    best_loss_ = WatchedLoss();
    rows_since_best_ = 0;
  }
  if (options_.on_evaluation) options_.on_evaluation(weights(), history());
}

void TrainingRun::End(ceres::TerminationType type, const std::string& message) {
  has_ended_ = true;
  TrainSummary& summary = summary_;
  summary.termination_type = type;
  summary.message = message;
  if (phases_.size() > 1 && message != BudgetSpent()) {
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

// --- Position and budget ---

double TrainingRun::epoch() const {
  if (!error().empty()) return 0.0;
  return first_epoch_ +
         static_cast<double>(steps_of_phase()) / engine().steps_per_epoch();
}

double TrainingRun::progress() const {
  return std::min(1.0,
                  std::max({epoch() / options_.max_num_epochs,
                            static_cast<double>(step_) /
                                static_cast<double>(options_.max_num_steps),
                            seconds_ / options_.max_time_in_seconds}));
}

// Epochs of different phases differ in length, so sums of epochs have rounding
// errors.
double TrainingRun::EpochsLeft(double epoch) const {
  constexpr double kRounding = 1e-12;
  return options_.max_num_epochs * (1.0 - kRounding) - epoch;
}

std::string TrainingRun::BudgetSpent() const {
  if (EpochsLeft(epoch()) <= 0.0) return "epochs done";
  if (step_ >= options_.max_num_steps) return "steps done";
  if (seconds_ >= options_.max_time_in_seconds) return "time used up";
  return "";
}

double TrainingRun::WatchedLoss() const {
  const HistoryRow& last = history_.back();
  return data_.test.num_samples() > 0 ? last.test_loss : last.train_loss;
}

TrainResult TrainingRun::result() const {
  return {error(), weights(), history(), summary_};
}

}  // namespace invgrad
