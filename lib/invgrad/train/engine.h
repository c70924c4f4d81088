// An engine makes the steps of one phase of a training run (train.h): by an
// update rule on batches or by a minimizer of Ceres on all samples. The run
// owns all other parts: budget, clock, evaluations, callbacks, checkpoint.
#ifndef INVGRAD_TRAIN_ENGINE_H_
#define INVGRAD_TRAIN_ENGINE_H_

#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/types.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/method.h"
#include "invgrad/train.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/weight_ledger.h"

namespace invgrad {

class Engine {
 public:
  struct StepResult {
    enum class Outcome {
      kStepped,
      kEnded,  // by a criterion of the engine, without a step
      kFailed  // the weights are the last ones with a finite loss
    };
    Outcome outcome = Outcome::kFailed;
    // For a step: the loss on its batch before the step, and the summary for
    // callbacks. The run sets number and time of the iteration.
    double batch_loss = std::numeric_limits<double>::quiet_NaN();
    ceres::IterationSummary iteration;
    // Further steps of this engine do not pay; the run may hand over to another.
    bool has_stalled = false;
    // The reason of an end or a failure.
    ceres::TerminationType termination_type = ceres::FAILURE;
    std::string message;
  };

  // What the engine has done in this phase.
  struct Counts {
    long num_updates = 0;  // by the rule, one or more per step
    long num_undone = 0;   // of these
    // How the samples were pulled back; null without a pull-back.
    const PullBackCounts* pull_backs = nullptr;
    int batch_size = 0;  // of the next step
    // The passes over the data, where batches differ in size; none:
    // steps / steps_per_epoch().
    std::optional<double> epochs;
  };

  // has_state: whether VisitState covers the whole state. If not, the run writes
  // no checkpoint while the engine runs. reports_best: whether the run reports
  // the weights with the lowest train loss that it has evaluated, not the last.
  Engine(long steps_per_epoch, bool has_state, bool reports_best = false)
      : steps_per_epoch_(steps_per_epoch),
        has_state_(has_state),
        reports_best_(reports_best) {}
  virtual ~Engine() = default;

  // With the batch size of the first step.
  long steps_per_epoch() const { return steps_per_epoch_; }
  bool has_state() const { return has_state_; }
  bool reports_best() const { return reports_best_; }

  // Moves the weights by one step. `progress`: the share of the phase's budget
  // that is spent, in [0, 1]. The address of the weights must be the same for
  // all steps.
  virtual StepResult Step(double progress, Eigen::VectorXd* weights) = 0;

  // Goes back to weights of the ledger.
  //   kNoLoss  the train loss is not finite, or the last step has failed: undoes
  //            the last step, or returns to `best`, the weights of the lowest
  //            train loss that was evaluated (empty: none). Returns false, and
  //            does nothing, if the rule neither has a judge nor evaluates the
  //            loss at other points, or if there is nothing to go back to.
  //   kEnd     the run has diverged, and ends with the last weights with a finite
  //            batch loss.
  virtual bool Undo(UndoReason /*reason*/,
                    const Eigen::VectorXd& /*best*/,
                    Eigen::VectorXd* /*weights*/) {
    return false;
  }

  // The weights that a run reports for `weights`: the same, with the best output
  // layer for them, or a mean of the last ones (raced_engine.h).
  virtual Eigen::VectorXd Finished(const Eigen::VectorXd& weights) {
    return weights;
  }

  virtual Counts counts() const = 0;
  int batch_size() const { return counts().batch_size; }
  std::optional<double> epochs() const { return counts().epochs; }

  virtual void VisitState(StateArchive* /*archive*/) {}

  // Ends the phase; returns a text for the run's message.
  virtual std::string Finish() { return ""; }

 private:
  const long steps_per_epoch_;
  const bool has_state_;
  const bool reports_best_;
};

// Makes the engine of a phase by `rule` (null if the phase has none): a rule
// lowers the loss of the model, a joint loss, or the proxy of a pull-back
// through the model; a minimizer of Ceres lowers the loss. Model, data and
// options must outlive the engine; the options have initial weights and a batch
// size >= 0. Returns null, with *error set, for bad input: a batch size out of
// range, a method that does not fit the model or the data (a trust region
// without a least-squares loss, supervised training without solutions, ...), or
// too little memory. *memory: what a step needs, "batch_size=100 needs 41 MB
// (...)".
std::unique_ptr<Engine> MakeEngine(const Phase& phase,
                                   std::shared_ptr<UpdateRule> rule,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   std::string* memory,
                                   std::string* error);

// The engine of a minimizer of Ceres on all samples, with or without proposals
// of its rule or pull-back. Every iteration, also a rejected one, is a step and
// an epoch. Ends when the solve ends by itself; has no state for a checkpoint.
std::unique_ptr<Engine> MakeCeresEngine(
    const Phase& phase,
    const Model* model,
    const DataSet* train,
    std::shared_ptr<const InverseSimulator> inverse);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_ENGINE_H_
