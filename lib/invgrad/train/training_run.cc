#include "invgrad/train/training_run.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <new>
#include <utility>

#include "fmt/core.h"
#include "invgrad/distributed/distributed_objective.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/io/format.h"

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

bool TrainingRun::Impl::Step() {
  if (!error().empty() || has_ended_) return false;
  if (!has_begun_) Begin();
  return IsRunning() && TakeStep();
}

void TrainingRun::Impl::Stop() {
  if (!error().empty() || has_ended_) return;
  if (!has_begun_) Begin();
  if (!has_ended_)
    End(ceres::USER_SUCCESS, AtStep("stopped", steps_of_phase()));
}

void TrainingRun::Impl::Begin() {
  has_begun_ = true;
  // A resumed run already has the evaluation before its first step; another
  // evaluation may be due.
  if (!history().empty()) {
    EvaluateIfDue();
    return;
  }
  if (!EvaluateOrEnd()) return;
  ceres::IterationSummary start;
  start.step_is_valid = true;
  start.step_is_successful = true;
  start.cost = history().back().train_loss;
  if (CallBack(start)) SaveIfDue();
}

bool TrainingRun::Impl::IsRunning() {
  while (!has_ended_) {
    const HistoryRow& last = history().back();
    if (options_.target_loss > 0.0 && last.step == state_.step &&
        last.train_loss <= options_.target_loss) {
      End(ceres::CONVERGENCE, AtStep("target loss reached", steps_of_phase()));
    } else if (options_.patience > 0 &&
               state_.rows_since_best >= options_.patience) {
      if (SpentOfPhase() < phase().early_share && HandOver()) continue;
      End(ceres::CONVERGENCE,
          fmt::format("no improvement in {} evaluations", options_.patience));
    } else if (!BudgetSpent().empty()) {
      End(ceres::NO_CONVERGENCE, BudgetSpent());
    } else if (!IsShareSpent() ||
               next_phase() == static_cast<int>(phases_.size())) {
      return true;
    } else {
      BeginNextPhase();
    }
  }
  return false;
}

void TrainingRun::Impl::BeginNextPhase() {
  if (last_evaluation() != state_.step && !EvaluateOrEnd()) return;
  const int next = next_phase();
  if (!phases_[next].engine->has_state()) SaveCheckpoint(Checkpoint());
  state_.weights = Reported();
  TakeBetterWeights(history().back().train_loss);
  state_.first_epoch = epoch();
  state_.first_step = state_.step;
  state_.first_second = state_.seconds;
  state_.phase = next;
  LimitPhase();
  state_.best_loss = WatchedLoss();
  state_.rows_since_best = 0;
  if (phase().is_trial()) state_.first_weights = weights();
}

int TrainingRun::Impl::CountPhases(int end) const {
  int count = 0;
  for (int k = 0; k < end; ++k) {
    if (k == 0 || !phases_[k - 1].is_trial()) ++count;
  }
  return count;
}

bool TrainingRun::Impl::HandOver() {
  if (!phase().is_trial()) return false;
  if (last_evaluation() != state_.step) Evaluate();
  state_.loss_set_aside = history().back().train_loss;
  state_.set_aside.resize(0);
  if (std::isfinite(state_.loss_set_aside)) {
    state_.set_aside = Reported();
  } else if (state_.best_step >= state_.first_step) {
    state_.set_aside = state_.best_weights;
    state_.loss_set_aside = state_.best_train_loss;
  }
  state_.weights = state_.first_weights;
  ++state_.phase;
  LimitPhase();
  state_.best_loss = std::numeric_limits<double>::infinity();
  state_.rows_since_best = 0;
  state_.best_train_loss = std::numeric_limits<double>::infinity();
  state_.best_weights.resize(0);
  return true;
}

bool TrainingRun::Impl::TakeStep() {
  Engine::StepResult result;
  try {
    result = EngineStep();
  } catch (const std::bad_alloc&) {
    // Other ranks would wait for this one.
    if (options_.communicator != nullptr) throw;
    End(ceres::FAILURE,
        AtStep("out of memory", steps_of_phase() + 1) + ": " +
            phases_[state_.phase].memory);
    return false;
  }
  using Outcome = Engine::StepResult::Outcome;
  if (!std::isnan(result.batch_loss)) state_.batch_loss = result.batch_loss;
  if (result.outcome == Outcome::kFailed) {
    if (HandOver() ||
        engine().Undo(
            UndoReason::kNoLoss, state_.best_weights, &state_.weights)) {
      ShareClock();
      return IsRunning() && TakeStep();
    }
    End(ceres::FAILURE,
        AtStep("diverged", steps_of_phase() + 1) + ": " + result.message);
    return false;
  }
  if (result.outcome == Outcome::kEnded) {
    End(result.termination_type, result.message);
    return false;
  }
  ++state_.step;
  state_.step_norm = result.iteration.step_norm;
  if (!CallBack(result.iteration)) return true;
  if (result.has_stalled) HandOver();
  EvaluateIfDue();
  return true;
}

bool TrainingRun::Impl::CallBack(ceres::IterationSummary iteration) {
  iteration.iteration = static_cast<int>(state_.step);
  iteration.cumulative_time_in_seconds = state_.seconds;
  ceres::CallbackReturnType answer = ceres::SOLVER_CONTINUE;
  for (ceres::IterationCallback* callback : options_.callbacks) {
    answer = (*callback)(iteration);
    if (answer != ceres::SOLVER_CONTINUE) break;
  }
  double num_aborts = answer == ceres::SOLVER_ABORT ? 1.0 : 0.0;
  double num_stops = answer == ceres::SOLVER_TERMINATE_SUCCESSFULLY ? 1.0 : 0.0;
  is_checkpoint_due_ = IsCheckpointDue();
  if (options_.communicator != nullptr) {
    const double of_clock = is_first_rank() ? 1.0 : 0.0;
    double sums[] = {of_clock * state_.seconds,
                     is_checkpoint_due_ ? of_clock : 0.0,
                     num_aborts,
                     num_stops};
    options_.communicator->Sum(sums, std::size(sums));
    state_.seconds = sums[0];
    is_checkpoint_due_ = sums[1] > 0.0;
    num_aborts = sums[2];
    num_stops = sums[3];
  }
  AddCalls();
  if (num_aborts > 0.0) {
    End(ceres::USER_FAILURE, AtStep("aborted by a callback", steps_of_phase()));
  } else if (num_stops > 0.0) {
    End(ceres::USER_SUCCESS, AtStep("stopped by a callback", steps_of_phase()));
  }
  return num_aborts == 0.0 && num_stops == 0.0;
}

void TrainingRun::Impl::EvaluateIfDue() {
  if (IsEvaluationDue()) {
    Evaluate();
    if (!std::isfinite(history().back().train_loss) && !HandOver()) {
      EndDiverged();
      return;
    }
  }
  SaveIfDue();
}

void TrainingRun::Impl::SaveIfDue() {
  if (is_checkpoint_due_) SaveCheckpoint(Checkpoint());
}

bool TrainingRun::Impl::EvaluateOrEnd() {
  Evaluate();
  // The initial weights may have a finite loss where a solved layer has none.
  if (state_.step == 0 && !std::isfinite(history().back().train_loss) &&
      HandOver()) {
    state_.history.clear();
    Evaluate();
  }
  if (std::isfinite(history().back().train_loss)) return true;
  EndDiverged();
  return false;
}

void TrainingRun::Impl::EndDiverged() {
  double ignored = 0.0;
  std::string why;
  const Eigen::VectorXd finished = engine().Finished(weights());
  DistributedCost(model_,
                  finished,
                  data_.train,
                  options_.communicator.get(),
                  &ignored,
                  &why);
  const std::string where =
      state_.step == 0
          ? fmt::format(
                "the loss is not finite at the initial weights{}: ",
                finished == weights() ? "" : " with the output layer solved")
          : AtStep("diverged", steps_of_phase()) +
                ": the train loss is not finite: ";
  engine().Undo(UndoReason::kEnd, state_.best_weights, &state_.weights);
  Summarize(ceres::FAILURE, where + why);
  double train_loss =
      MeanLoss(model_, weights(), data_.train, options_.communicator.get());
  summary_.message += TakeBestWeights(&train_loss);
  summary_.message += TakeBetterWeights(train_loss);
}

std::string TrainingRun::Impl::TakeBestWeights(double* train_loss) {
  if (state_.best_weights.size() == 0 ||
      *train_loss <= state_.best_train_loss) {
    return "";
  }
  state_.weights = state_.best_weights;
  *train_loss = state_.best_train_loss;
  return fmt::format(
      "; final weights are the best that were evaluated, of step {} (train "
      "loss {})",
      state_.best_step,
      FormatNumber(state_.best_train_loss));
}

void TrainingRun::Impl::Evaluate() {
  AddCalls();
  HistoryRow row;
  row.step = state_.step;
  row.epoch = epoch();
  row.seconds = state_.seconds;
  row.batch_size = engine().batch_size();
  row.simulator_calls = static_cast<double>(state_.simulator_calls);
  row.batch_loss = state_.batch_loss;
  row.step_norm = state_.step_norm;
  const bool has_test_data = data_.test.num_samples() > 0;
  const auto mean_loss = [this](const Eigen::VectorXd& w, const DataSet& data) {
    return MeanLoss(model_, w, data, options_.communicator.get());
  };
  Eigen::VectorXd finished = engine().Finished(weights());
  row.train_loss = mean_loss(finished, data_.train);
  while (!std::isfinite(row.train_loss) &&
         engine().Undo(
             UndoReason::kNoLoss, state_.best_weights, &state_.weights)) {
    finished = engine().Finished(weights());
    row.train_loss = mean_loss(finished, data_.train);
  }
  if (engine().reports_best() && state_.best_train_loss < row.train_loss) {
    finished = state_.best_weights;
    row.train_loss = state_.best_train_loss;
  }
  if (has_test_data) row.test_loss = mean_loss(finished, data_.test);
  if (options_.metric) row.metric = options_.metric(finished);
  const PullBackCounts* pull_backs = engine().counts().pull_backs;
  if (pull_backs != nullptr) FillCounts(*pull_backs, &row);
  state_.history.push_back(row);
  if (row.train_loss < state_.best_train_loss) {
    state_.best_weights = finished;
    state_.best_train_loss = row.train_loss;
    state_.best_step = state_.step;
  }
  ++state_.rows_since_best;
  if (WatchedLoss() < state_.best_loss) {
    state_.best_loss = WatchedLoss();
    state_.rows_since_best = 0;
  }
  if (options_.on_evaluation) options_.on_evaluation(finished, history());
}

Eigen::VectorXd TrainingRun::Impl::Reported() {
  const bool reports_best =
      engine().reports_best() && state_.best_weights.size() > 0;
  return reports_best ? state_.best_weights : engine().Finished(weights());
}

void TrainingRun::Impl::End(ceres::TerminationType type,
                            const std::string& message) {
  engine().Finish();  // sets the final weights of a minimizer of Ceres
  // Made before the evaluation below, which a longer run would not make.
  const bool can_go_on = type != ceres::FAILURE && type != ceres::CONVERGENCE;
  const StateArchive checkpoint = can_go_on ? Checkpoint() : StateArchive();
  if (type == ceres::FAILURE) {
    if (last_evaluation() != state_.step) Evaluate();
  } else if (last_evaluation() != state_.step && !EvaluateOrEnd()) {
    return;
  }
  if (can_go_on) SaveCheckpoint(checkpoint);
  Summarize(type, message);
  state_.weights = Reported();
  double train_loss = history().back().train_loss;
  if (type == ceres::FAILURE) {
    summary_.message += TakeBestWeights(&train_loss);
  }
  summary_.message += TakeBetterWeights(train_loss);
}

std::string TrainingRun::Impl::TakeBetterWeights(double trained) {
  if (!follows_trial()) return "";
  HistoryRow row = history().back();
  const double solved = state_.loss_set_aside;
  const bool takes_solved = state_.set_aside.size() > 0 && !(trained <= solved);
  if (takes_solved) {
    row.train_loss = solved;
    if (data_.test.num_samples() > 0) {
      row.test_loss = MeanLoss(model_, state_.set_aside, data_.test);
    }
    state_.weights = state_.set_aside;
    if (solved < state_.best_train_loss) {
      state_.best_weights = state_.set_aside;
      state_.best_train_loss = solved;
      state_.best_step = state_.step;
    }
    if (options_.metric) row.metric = options_.metric(weights());
    state_.history.push_back(row);
    if (options_.on_evaluation) options_.on_evaluation(weights(), history());
  }
  state_.set_aside.resize(0);
  return fmt::format(
      "; output layer solved first (train loss {}), then trained ({}): final "
      "weights of the {}",
      FormatNumber(solved),
      FormatNumber(trained),
      takes_solved ? "former" : "latter");
}

void TrainingRun::Impl::Summarize(ceres::TerminationType type,
                                  const std::string& message) {
  has_ended_ = true;
  TrainSummary& summary = summary_;
  summary.termination_type = type;
  summary.message = message;
  if (CountPhases(static_cast<int>(phases_.size())) > 1 &&
      message != BudgetSpent()) {
    summary.message =
        fmt::format("phase {}: {}", CountPhases(state_.phase + 1), message);
  }
  std::string reports;
  for (int k = 0; k <= state_.phase; ++k)
    reports += phases_[k].engine->Finish();
  summary.num_steps = state_.step;
  summary.train_time_in_seconds = state_.seconds;
  for (int k = 0; k <= state_.phase; ++k) {
    const Engine::Counts counts = phases_[k].engine->counts();
    summary.num_updates += counts.num_updates;
    summary.num_undone += counts.num_undone;
  }
  if (summary.num_undone > 0) {
    summary.message += fmt::format(
        "; {} of {} steps undone", summary.num_undone, summary.num_updates);
  }
  summary.message += reports;
}

}  // namespace invgrad
