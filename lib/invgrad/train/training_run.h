// The loop of a training run, behind TrainingRun (train.h): training_run.cc has
// the steps and phases, training_budget.cc the position in the budget and what
// steps cost, train_setup.cc construction and checkpoint.
//
// A phase may be a trial: it hands over to the next one where it stalls, diverges
// or exhausts the patience early. The next one then begins with the trial's first
// weights, has the rest of its budget, and ends with the better weights of both. A
// trial that does not hand over ends as any phase, and the next one is left out.
#ifndef INVGRAD_TRAIN_TRAINING_RUN_H_
#define INVGRAD_TRAIN_TRAINING_RUN_H_

#include <chrono>
#include <ctime>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/types.h"
#include "invgrad/chain/counted_simulator.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/method.h"
#include "invgrad/train.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/engine.h"
#include "invgrad/train/run_identity.h"

namespace invgrad {

class TrainingRun::Impl {
 public:
  // One of the Add functions must follow.
  Impl(const Model& model, TrainingData data, TrainOptions options);

  // The phases of the method, or one phase by a rule of the caller; then resumes
  // from a checkpoint.
  void Add(const std::string& method);
  void Add(const Method& method);
  void Add(std::shared_ptr<UpdateRule> rule);

  // As those of TrainingRun.
  bool Step();
  void Stop();
  const std::string& error() const { return error_; }
  const Eigen::VectorXd& weights() const { return state_.weights; }
  const History& history() const { return state_.history; }
  double loss() const { return state_.batch_loss; }
  long step() const { return state_.step; }
  double epoch() const;
  double progress() const;
  const RunIdentity& identity() const { return identity_; }
  const TrainSummary& summary() const { return summary_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct RunPhase {
    std::unique_ptr<Engine> engine;
    long max_num_steps = 0;  // its share of the run
    std::string memory;      // of a step, estimated
    // Its share of the run, where batches differ in size.
    double max_num_epochs = std::numeric_limits<double>::infinity();
    // Of a trial, the share of its budget in which the patience is early; else 0.
    double early_share = 0.0;

    bool is_trial() const { return early_share > 0.0; }
  };
  // What a checkpoint holds, with the states of the engines.
  struct State {
    Eigen::VectorXd weights;
    History history;
    double best_loss = std::numeric_limits<double>::infinity();  // watched
    int rows_since_best = 0;
    int phase = 0;
    // The weights of the lowest train loss that was evaluated; empty: none.
    Eigen::VectorXd best_weights;
    double best_train_loss = std::numeric_limits<double>::infinity();
    long best_step = 0;
    // The start of the phase.
    long first_step = 0;
    double first_epoch = 0.0;
    double first_second = 0.0;
    long step = 0;
    double seconds = 0.0;
    long simulator_calls = 0;  // of the steps, on all ranks
    double batch_loss = HistoryRow::kNone;
    double step_norm = HistoryRow::kNone;
    // Where a trial began; and, in the phase after it, the weights that are to be
    // surpassed, or none.
    Eigen::VectorXd first_weights;
    Eigen::VectorXd set_aside;
    double loss_set_aside = HistoryRow::kNone;
  };

  void AddPhases(const Method& method);
  // Also the phase that a trial hands over to.
  bool AddPhase(const Phase& phase, bool is_last);
  // The last part of Add: resumes from a checkpoint. `rule`: of the caller, or
  // null.
  void Start(const Method& method, const UpdateRule* rule);

  // The end of every Add: fails on all ranks if one of them has failed, or is of
  // another run.
  void AgreeWithRanks();
  bool is_first_rank() const {
    return options_.communicator == nullptr ||
           options_.communicator->rank() == 0;
  }

  // The first call of Step: evaluates the initial weights.
  void Begin();
  // Ends the run, or begins the next phase, if it is due. Returns false if the
  // run has ended.
  bool IsRunning();
  void BeginNextPhase();
  // Sets max_num_steps_ by the share of the phase and the run's budget.
  void LimitPhase();
  bool TakeStep();
  // One step of the engine, its time and its calls of the simulator.
  Engine::StepResult EngineStep();
  double Now() const {  // in seconds
    return options_.cpu_time
               ? static_cast<double>(std::clock()) / CLOCKS_PER_SEC
               : std::chrono::duration<double>(Clock::now().time_since_epoch())
                     .count();
  }
  // False if a callback has ended the run.
  bool CallBack(ceres::IterationSummary iteration);
  void Evaluate();
  // The weights of the last row of the history, which is of the present step.
  Eigen::VectorXd Reported();
  // Adds the calls of this rank since the last time, of all ranks.
  void AddCalls();
  // The seconds become those of the first rank.
  void ShareClock();
  // Evaluates the losses. If the train loss is not finite, ends the run as
  // diverged, and returns false.
  bool EvaluateOrEnd();
  // Ends with the last good weights.
  void EndDiverged();
  // After a failure: takes the weights of the lowest train loss that was
  // evaluated, if it is below *train_loss, that of the last good weights, and
  // sets *train_loss. Returns a text for the message.
  std::string TakeBestWeights(double* train_loss);
  bool IsEvaluationDue() const;
  // Evaluates the losses and writes a checkpoint if they are due.
  void EvaluateIfDue();
  void SaveIfDue();
  bool IsCheckpointDue() const;  // by the clock of this rank
  // Evaluates and saves the final state. `message` counts steps from the start
  // of the phase.
  void End(ceres::TerminationType type, const std::string& message);
  void Summarize(ceres::TerminationType type, const std::string& message);

  const RunPhase& phase() const { return phases_[state_.phase]; }
  Engine& engine() const { return *phase().engine; }
  // The phase after this one, or the number of phases.
  int next_phase() const { return state_.phase + (phase().is_trial() ? 2 : 1); }
  // The phases before `end` that a method has; a trial counts with the one after
  // it.
  int CountPhases(int end) const;
  bool follows_trial() const {
    return state_.phase > 0 && phases_[state_.phase - 1].is_trial();
  }
  // If this phase is a trial, begins the next one in its place.
  bool HandOver();
  // After a trial, takes the weights that are set aside if their train loss is
  // lower than `trained`, that of weights(). Returns a text for the message.
  std::string TakeBetterWeights(double trained);

  // Empty while some budget is left; then a reason such as "epochs done".
  std::string BudgetSpent() const;
  double EpochsLeft(double epoch) const;
  // Whether the phase has had its share of the run.
  bool IsShareSpent() const;
  // The share of the phase's budget, in [0, 1].
  double SpentOfPhase() const;
  // The last test loss, or train loss if there are no test data.
  double WatchedLoss() const;
  long steps_of_phase() const { return state_.step - state_.first_step; }
  long last_evaluation() const { return history().back().step; }

  StateArchive Checkpoint();
  void SaveCheckpoint(const StateArchive& archive);
  void Restore();
  void VisitState(StateArchive* archive, State* state);

  // Counts the calls of model_, on this rank.
  const std::shared_ptr<const CountedSimulator> simulator_;
  const Model model_;
  const TrainingData data_;
  TrainOptions options_;
  std::string error_;
  TrainSummary summary_;
  bool has_begun_ = false;
  bool has_ended_ = false;

  RunIdentity identity_;
  State state_;
  double new_calls_ = 0.0;  // of this rank, not yet in the state
  // Destroyed before the weights, because an unfinished solve may write to
  // them.
  std::vector<RunPhase> phases_;
  long max_num_steps_ = 0;  // of the phase
  Clock::time_point last_checkpoint_ = Clock::now();
  // After the last step, by the clock of the first rank. All ranks make a
  // checkpoint or none: a rule may need all of them after it (kfac_rule.cc).
  bool is_checkpoint_due_ = false;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_RUN_H_
