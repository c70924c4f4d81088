// Trains a model (model.h): a network in front of a simulator, by any method
// (method.h). Use Train for a whole run, and TrainingRun to take the steps
// yourself. The history of the losses, which this header also reads and writes,
// is a part of the result. For a simulator without a network use minimize.h.
//
//   TrainResult result = Train(model, {inputs, targets}, "adaptive");
//
// or step by step:
//
//   TrainingRun run(model, data, "adam:epochs=5>half_inverse", options);
//   while (run.Step()) std::printf("%ld %g\n", run.step(), run.loss());
//
// The run owns budget, clock, patience, history, callbacks and checkpoint; the
// engine of each phase takes the steps (engine.h): a rule on batches or a
// minimizer of Ceres on all samples.
//
// Time is the wall-clock time of the steps or, with cpu_time, the processor's,
// of all threads: that compares methods fairly on a busy machine. Evaluations,
// callbacks and checkpoints are not counted. Losses are evaluated before the
// first step, after the epochs of IsEvaluationEpoch, and at the end of a phase.
//
// Phases share the weights and the counts of steps, epochs and seconds. Each
// phase has a new rule, its own schedule and patience, and begins with the
// first sample or with the first order of the seed: its steps are, bit for bit,
// those of a separate run from the final weights of the previous phase. Target
// loss, patience, a callback or divergence in any phase end the whole run; the
// message then names the phase and counts from the start of the phase. An epoch
// budget ends a run at the first step that reaches it.
//
// A phase with output_layer=auto solves the output layer. If that diverges, has
// stalled after a tenth of the phase (steady_fall.h), or exhausts the patience
// before that, the phase goes back to its first weights and trains all layers,
// with the rest of its budget. It ends with the weights of the lower train
// loss: the last ones, or those that the solutions had led to.
//
// Determinism: the same inputs give the same bits, and a resumed run ends like
// an uninterrupted one (except for times, and thus for a budget in seconds).
// Fails:   bad input (an unknown method, a wrong batch size, data that are not
//          finite, too little memory, a checkpoint that is damaged or of
//          another run) sets error(), and the run does nothing. A numerical
//          failure ends the run as ceres::FAILURE, "diverged at step k: ...";
//          the weights are those of the last step with a finite batch loss or,
//          if their train loss is higher or not finite, the best that were
//          evaluated, as the message says. A rule that judges its steps goes
//          back to these, and goes on with smaller steps; one that evaluates the
//          loss at other points (adaptive, geodesic), with other batches.
//          Consistent sizes are CHECKed.
#ifndef INVGRAD_TRAIN_H_
#define INVGRAD_TRAIN_H_

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/types.h"
#include "invgrad/data.h"
#include "invgrad/model.h"

namespace invgrad {

// The history of a run: one row per evaluation.
//
//   step,epoch,seconds,batch_loss,train_loss,test_loss,step_norm,metric,...
//   0,0,0,,0.25,0.26,,,,,,,,32,0
//   16,0.5,0.021,0.24,,,1.5e-3,,,,,,,32,1024
//
// The next columns are by_inverse, by_numerical_inverse, by_inverse_gradient,
// by_gradient and not_moved: for methods that invert the simulator, the number
// of samples since the first step by the source of their d_x
// (simulator_pull_back.h). Then there is batch_size, of the next step. The last
// one is simulator_calls, which the steps have made until then
// (chain/counted_simulator.h); like the seconds, evaluations of losses do not
// count.
//
// CSV with this header line; numbers with the fewest digits that read back as
// the same value. An unknown value is an empty field (NaN in memory); an
// overflowed loss is "inf". Written atomically (atomic_file.h).
//
// Fails:   returns false with a message that names the file and, for reading,
//          the line; *history is then unchanged.
struct HistoryRow {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  long step = 0;
  double epoch = 0.0;
  double seconds = 0.0;  // of training; evaluation is not counted
  double batch_loss = kNone;
  double train_loss = kNone;
  double test_loss = kNone;
  double step_norm = kNone;
  double metric = kNone;  // TrainOptions::metric
  double by_inverse = kNone;
  double by_numerical_inverse = kNone;
  double by_inverse_gradient = kNone;
  double by_gradient = kNone;
  double not_moved = kNone;
  double batch_size = kNone;
  double simulator_calls = kNone;
};

// All columns but the step, in the order of the file.
struct HistoryColumn {
  const char* name;
  double HistoryRow::*value;
};
inline constexpr HistoryColumn kHistoryColumns[] = {
    {"epoch", &HistoryRow::epoch},
    {"seconds", &HistoryRow::seconds},
    {"batch_loss", &HistoryRow::batch_loss},
    {"train_loss", &HistoryRow::train_loss},
    {"test_loss", &HistoryRow::test_loss},
    {"step_norm", &HistoryRow::step_norm},
    {"metric", &HistoryRow::metric},
    {"by_inverse", &HistoryRow::by_inverse},
    {"by_numerical_inverse", &HistoryRow::by_numerical_inverse},
    {"by_inverse_gradient", &HistoryRow::by_inverse_gradient},
    {"by_gradient", &HistoryRow::by_gradient},
    {"not_moved", &HistoryRow::not_moved},
    {"batch_size", &HistoryRow::batch_size},
    {"simulator_calls", &HistoryRow::simulator_calls}};

using History = std::vector<HistoryRow>;

bool WriteHistory(const std::string& path,
                  const History& history,
                  std::string* error);
bool ReadHistory(const std::string& path, History* history, std::string* error);

class Communicator;
class InverseSimulator;
struct Method;
class RunIdentity;
class UpdateRule;

struct TrainingData {
  // Without contexts and without test data. inputs: |a| x N; targets: |y| x N.
  TrainingData(Eigen::MatrixXd inputs, Eigen::MatrixXd targets);
  TrainingData(DataSet train,  // NOLINT: a data set is training data.
               DataSet test = DataSet(),
               std::shared_ptr<const DataSource> source = nullptr);
  DataSet train;
  DataSet test;  // may have no samples
  // Null, or where a rule's batches come from; `train` then serves to evaluate
  // the train loss, and its size is that of an epoch. Minimizers of Ceres,
  // which have no batches, use `train`.
  std::shared_ptr<const DataSource> source;
};

struct TrainOptions {
  static constexpr int kDefaultBatchSize = 32;
  // 0: all samples; -1: 32, or all if there are fewer. Samples at the end of an
  // epoch that do not fill a batch are left out of it: without `shuffle` these
  // are the same in every epoch, as the message of the run says.
  int batch_size = -1;

  // A new order each epoch, np.random.permutation of a stream of the seed.
  bool shuffle = false;
  // The seed of the orders, and of the initial weights if none are given.
  std::uint32_t seed = 0;

  Eigen::VectorXd initial_weights;  // n; empty: Glorot-uniform ones

  // The inverse of the simulator, for methods that use it; null: the numerical
  // inverse.
  std::shared_ptr<const InverseSimulator> inverse;

  // The budget; the first limit ends the run. 100 epochs if none is set.
  static constexpr int kDefaultNumEpochs = 100;
  int max_num_epochs = std::numeric_limits<int>::max();
  long max_num_steps = std::numeric_limits<long>::max();
  double max_time_in_seconds = std::numeric_limits<double>::infinity();
  bool cpu_time = false;  // seconds are those of the processor

  // Early stop: train loss <= target_loss; or no new minimum of the test loss
  // (of the train loss if there are no test data) in `patience` evaluations. 0:
  // off. The weights of the lowest test loss are not kept; `on_evaluation` can
  // keep them.
  double target_loss = 0.0;
  int patience = 0;

  // Computes the metric of the history from the weights. Null: none.
  std::function<double(const Eigen::VectorXd& weights)> metric;

  // The threads over the samples of a batch; the results do not depend on it.
  int num_threads = 1;

  // The limit on the run's memory, in bytes; 0: the limit of memory_limit.h. It
  // is checked before the run, by estimates. Where a rule falls back to a dearer
  // decomposition in a step, the limit of memory_limit.h counts.
  double memory_limit = 0.0;

  // Null, or the ranks that share the run (internal/communicator.h): each
  // evaluates a share of every batch, by the same functions in the same order,
  // and every rank has the results. The steps are those of one process up to
  // rounding. The first rank's clock counts, and it alone writes the
  // checkpoint, which all must be able to read. A callback on any rank ends the
  // run on all; Stop is called on all or on none.
  std::shared_ptr<const Communicator> communicator;

  // Called before the first step and after every step; IterationSummary::cost
  // is the batch loss that the step started from, and with a minimizer of Ceres
  // its cost after the step. Not owned. SOLVER_TERMINATE_SUCCESSFULLY ends the
  // run, results kept.
  std::vector<ceres::IterationCallback*> callbacks;

  // Called after each new row of the history.
  std::function<void(const Eigen::VectorXd& weights, const History& history)>
      on_evaluation;

  // If not empty, the run writes a checkpoint to this file between steps, at
  // most once per checkpoint_interval_in_seconds, and when the budget or a
  // callback ends the run. If the file exists, the run resumes from it: it must
  // be of the same run (run_identity.h), with any budget that it has not
  // exceeded, or with the same one if the method has a schedule. A rule object
  // is identified by its class, not by its settings. A minimizer of Ceres
  // writes no checkpoint.
  std::string checkpoint_path;
  double checkpoint_interval_in_seconds = 10.0;
};

struct TrainSummary {
  ceres::TerminationType termination_type = ceres::FAILURE;
  std::string message;  // "epochs done", "diverged at step 17: ..."
  long num_steps = 0;
  long num_updates = 0;  // updates by the rule, one or more per step
  long num_undone = 0;   // updates that the rule undid
  double train_time_in_seconds = 0.0;
};

struct TrainResult {
  std::string error;        // not empty for bad input: the run did nothing
  Eigen::VectorXd weights;  // n
  History history;
  TrainSummary summary;
};

// The mean loss over the samples for any reduction of the model, so that runs
// with different batch sizes compare; NaN if the loss cannot be computed.
// communicator: null, or the ranks that share the samples.
double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data,
                const Communicator* communicator = nullptr);

// True after each of the first 40 epochs, and then whenever the number of
// epochs has grown by 1/40 to 1/20. This suffices for a logarithmic axis, and
// does not depend on the machine's speed.
bool IsEvaluationEpoch(long epoch);

class TrainingRun {
 public:
  // `method` as in method.h.
  TrainingRun(const Model& model,
              TrainingData data,
              const std::string& method,
              TrainOptions options = TrainOptions());
  TrainingRun(const Model& model,
              TrainingData data,
              const Method& method,
              TrainOptions options);
  // Trains by a rule object of the caller, which must not have been used
  // before.
  TrainingRun(const Model& model,
              TrainingData data,
              std::shared_ptr<UpdateRule> rule,
              TrainOptions options);
  ~TrainingRun();
  TrainingRun(const TrainingRun&) = delete;
  TrainingRun& operator=(const TrainingRun&) = delete;

  // Takes one step. Returns false, without a step, after the end of the run. In
  // a race of batch sizes (batch_size=auto of method.h) the weights after a step
  // may be those of a slice that loses. History, metric and result are those of
  // the weights that the run reports (train/raced_engine.h).
  bool Step();

  // Ends the run and keeps its results; a checkpoint allows to resume it.
  void Stop();

  // Not empty for bad input: the run does nothing.
  const std::string& error() const;
  const Eigen::VectorXd& weights() const;
  const History& history() const;
  // The loss of the last step's batch, before the step; with a minimizer of
  // Ceres its lowest cost. NaN before the first step.
  double loss() const;
  long step() const;
  double epoch() const;
  // The share of the run's budget that is spent, in [0, 1].
  double progress() const;
  // What determines the run; only with a checkpoint_path.
  const RunIdentity& identity() const;
  // The reason of the end, after Step() has returned false.
  const TrainSummary& summary() const;
  TrainResult result() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Trains until the run ends. `method`: a specification, a Method, or a rule, as
// for TrainingRun.
template <typename MethodOrRule>
TrainResult Train(const Model& model,
                  TrainingData data,
                  const MethodOrRule& method,
                  TrainOptions options = TrainOptions()) {
  TrainingRun run(model, std::move(data), method, std::move(options));
  while (run.Step()) continue;
  return run.result();
}

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_H_
