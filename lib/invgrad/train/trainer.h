// Trains a model by the steps of an update rule, batch after batch.
//
//   theta_{k+1} = theta_k + rule(linearization of the model on batch k)
//
// A batch is `batch_size` consecutive samples of an epoch's order; the last
// samples of an epoch that do not fill a batch are left out. Training time
// is the wall-clock time of linearizations and steps; evaluations, callbacks
// and checkpoints are not counted.
//
// The loss over a data set is the mean over its samples, whatever the model's
// reduction is, so that runs of different batch sizes compare. It is looked at
// before the first step, after each of the first 40 epochs, and then each time
// that the number of epochs has grown by 1/40 to 1/20: enough for a logarithmic
// axis, and independent of the machine's speed.
//
// Determinism: the same inputs give the same bits, and a run that is continued
// from its checkpoint ends like one that was never stopped (but for the times,
// and hence for a budget in seconds).
// Fails:   a numerical failure (no finite loss, no finite step) ends the run as
//          ceres::FAILURE and "diverged at step k: ..."; the weights are those
//          of the last step with a finite batch loss.
//
// A rule that judges its steps (control=gain) has those that it refuses taken
// back, and the one before a batch, or an evaluation, without a finite loss
// too; the run goes on.
#ifndef INVGRAD_TRAIN_TRAINER_H_
#define INVGRAD_TRAIN_TRAINER_H_

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/types.h"
#include "invgrad/chain/model.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/train/history.h"

namespace invgrad {

struct TrainOptions {
  int batch_size = 0;  // 0: all samples

  // A new order each epoch, np.random.permutation of a stream of this seed.
  bool shuffle = false;
  std::uint32_t shuffle_seed = 0;

  // The budget: whichever ends first. At least one must be finite (CHECKed).
  int max_num_epochs = std::numeric_limits<int>::max();
  long max_num_steps = std::numeric_limits<long>::max();
  double max_time_in_seconds = std::numeric_limits<double>::infinity();

  // Early stop: train loss <= target_loss; or no new minimum of the test loss
  // (of the train loss, if there are no test data) in so many evaluations. 0:
  // off.
  double target_loss = 0.0;
  int patience = 0;

  // The history's metric of the weights. Null: none.
  std::function<double(const Eigen::VectorXd& weights)> metric;

  // What the rule gets to see: the proxy of a pull-back through the model's
  // loss and simulator, or, if null, the model itself. Not owned. A step is one
  // evaluation of the simulator, with all updates of the rule that belong to
  // it; how the samples were pulled back is counted in the history.
  ChainPullBack* pull_back = nullptr;

  // Of all that the run holds, in bytes; 0: that of memory_limit.h.
  double memory_limit = 0.0;

  // Called before the first step and after every step, with the weights up to
  // date; IterationSummary::cost is the batch loss that the step started from.
  // Not owned. SOLVER_TERMINATE_SUCCESSFULLY ends the run, results kept.
  std::vector<ceres::IterationCallback*> callbacks;

  // Called when a row has been added to the history.
  std::function<void(const History& history)> on_evaluation;

  // If not empty, a checkpoint is written there: at evaluations, at most this
  // often, and when the budget or a callback ends the run, between any two
  // steps. If the file exists, the run continues from it.
  std::string checkpoint_path;
  double checkpoint_interval_in_seconds = 10.0;
};

struct TrainSummary {
  ceres::TerminationType termination_type = ceres::FAILURE;
  std::string message;  // "epochs done", "diverged at step 17: ..."
  long num_steps = 0;
  long num_updates = 0;     // of the rule, one or more a step
  long num_taken_back = 0;  // of these, by the rule's own judgement
  double train_time_in_seconds = 0.0;
};

// `test` may have no samples. `weights` holds the initial weights and receives
// the final ones. Returns false only for bad input (a batch size that does not
// fit or needs too much memory, data that are not finite, a checkpoint of
// another run): then *error says what, and nothing was done.
bool Train(const TrainOptions& options,
           const Model& model,
           const DataSet& train,
           const DataSet& test,
           UpdateRule* rule,
           Eigen::VectorXd* weights,
           History* history,
           TrainSummary* summary,
           std::string* error);

// The mean loss over the samples; NaN if it cannot be computed.
double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data);

// True if losses are to be looked at after `epoch` epochs.
bool IsEvaluationEpoch(int epoch);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINER_H_
