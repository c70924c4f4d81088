// An engine takes the steps of one phase of a training run (train.h): an update
// rule on batches (rule_engine.h) or a minimizer of Ceres on all samples
// (ceres_engine.h). The run owns everything else: budget, clock, evaluations,
// callbacks, checkpoint.
#ifndef INVGRAD_TRAIN_ENGINE_H_
#define INVGRAD_TRAIN_ENGINE_H_

#include <limits>
#include <string>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/types.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/train/state_archive.h"

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
    // Of a step: the loss on its batch before it, and what callbacks get. The
    // run sets the iteration's number and time.
    double batch_loss = std::numeric_limits<double>::quiet_NaN();
    ceres::IterationSummary iteration;
    // Of an end or a failure.
    ceres::TerminationType termination_type = ceres::FAILURE;
    std::string message;
  };

  virtual ~Engine() = default;

  virtual long steps_per_epoch() const = 0;

  // Moves the weights by one step. `progress`: the share of the phase's budget
  // that is spent, in [0, 1]. The weights stay at the same address for all
  // steps.
  virtual StepResult Step(double progress, Eigen::VectorXd* weights) = 0;

  // Takes the last step back, because the train loss is not finite after it.
  // False, and nothing done, if the engine does not judge its steps.
  virtual bool TakeBack(Eigen::VectorXd* /*weights*/) { return false; }

  // Puts the weights back to the last ones with a finite loss of a batch.
  virtual void RestoreLastGood(Eigen::VectorXd* /*weights*/) {}

  // Of the rule, one or more a step, and how many of these were taken back.
  virtual long num_updates() const { return 0; }
  virtual long num_taken_back() const { return 0; }
  // How the samples were pulled back; null if they were not.
  virtual const PullBackCounts* counts() const { return nullptr; }

  // Whether VisitState holds all that a resumed run needs. If not, no
  // checkpoint is written while the engine runs.
  virtual bool has_state() const { return true; }
  virtual void VisitState(StateArchive* /*archive*/) {}

  // Ends the phase; returns what is to be added to the run's message.
  virtual std::string Finish() { return ""; }
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_ENGINE_H_
