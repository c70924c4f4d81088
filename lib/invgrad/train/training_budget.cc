// The position of a training run in its budget, and what its steps cost.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "invgrad/train/training_run.h"

namespace invgrad {

double TrainingRun::Impl::epoch() const {
  if (!error().empty()) return 0.0;
  return state_.first_epoch +
         engine().epochs().value_or(static_cast<double>(steps_of_phase()) /
                                    engine().steps_per_epoch());
}

double TrainingRun::Impl::progress() const {
  return std::min(1.0,
                  std::max({epoch() / options_.max_num_epochs,
                            static_cast<double>(state_.step) /
                                static_cast<double>(options_.max_num_steps),
                            state_.seconds / options_.max_time_in_seconds}));
}

double TrainingRun::Impl::SpentOfPhase() const {
  const double budget_in_seconds =
      options_.max_time_in_seconds - state_.first_second;
  double spent =
      std::max(static_cast<double>(steps_of_phase()) /
                   static_cast<double>(max_num_steps_),
               (state_.seconds - state_.first_second) / budget_in_seconds);
  if (engine().epochs().has_value()) {
    const double max_num_epochs =
        std::min(phase().max_num_epochs, EpochsLeft(state_.first_epoch));
    spent = std::max(spent, *engine().epochs() / max_num_epochs);
  }
  return std::min(1.0, spent);
}

bool TrainingRun::Impl::IsShareSpent() const {
  return steps_of_phase() >= max_num_steps_ ||
         engine().epochs().value_or(0.0) >= phase().max_num_epochs;
}

// Epochs of different phases differ in length, so sums of epochs have rounding
// errors.
double TrainingRun::Impl::EpochsLeft(double epoch) const {
  constexpr double kRounding = 1e-12;
  return options_.max_num_epochs * (1.0 - kRounding) - epoch;
}

std::string TrainingRun::Impl::BudgetSpent() const {
  if (EpochsLeft(epoch()) <= 0.0) return "epochs done";
  if (state_.step >= options_.max_num_steps) return "steps done";
  if (state_.seconds >= options_.max_time_in_seconds) return "time used up";
  return "";
}

double TrainingRun::Impl::WatchedLoss() const {
  const HistoryRow& last = state_.history.back();
  return data_.test.num_samples() > 0 ? last.test_loss : last.train_loss;
}

bool TrainingRun::Impl::IsEvaluationDue() const {
  if (last_evaluation() == state_.step) return false;
  if (!engine().epochs().has_value()) {
    const long steps_per_epoch = engine().steps_per_epoch();
    return steps_of_phase() % steps_per_epoch == 0 &&
           IsEvaluationEpoch(steps_of_phase() / steps_per_epoch);
  }
  // Steps may pass over the ends of epochs.
  const double evaluated = history().back().epoch - state_.first_epoch;
  for (long done = std::lround(std::floor(*engine().epochs()));
       static_cast<double>(done) > evaluated;
       --done) {
    if (IsEvaluationEpoch(done)) return true;
  }
  return false;
}

Engine::StepResult TrainingRun::Impl::EngineStep() {
  const double start = Now();
  const long calls = simulator_->num_calls();
  Engine::StepResult result = engine().Step(SpentOfPhase(), &state_.weights);
  state_.seconds += Now() - start;
  new_calls_ += static_cast<double>(simulator_->num_calls() - calls);
  return result;
}

void TrainingRun::Impl::ShareClock() {
  if (options_.communicator == nullptr) return;
  if (!is_first_rank()) state_.seconds = 0.0;
  options_.communicator->Sum(&state_.seconds, 1);
}

void TrainingRun::Impl::AddCalls() {
  if (options_.communicator != nullptr) {
    options_.communicator->Sum(&new_calls_, 1);
  }
  state_.simulator_calls += std::lround(new_calls_);
  new_calls_ = 0.0;
}

void TrainingRun::Impl::LimitPhase() {
  max_num_steps_ = phase().max_num_steps;
  if (options_.max_num_steps < std::numeric_limits<long>::max()) {
    max_num_steps_ =
        std::min(max_num_steps_, options_.max_num_steps - state_.first_step);
  }
  if (options_.max_num_epochs < TrainOptions().max_num_epochs &&
      !engine().epochs().has_value()) {
    // A step within an epoch may reach the budget.
    const double steps = EpochsLeft(state_.first_epoch) *
                         static_cast<double>(engine().steps_per_epoch());
    max_num_steps_ =
        std::min(max_num_steps_, static_cast<long>(std::ceil(steps)));
  }
}

}  // namespace invgrad
