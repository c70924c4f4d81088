// One method trained from one seed, and the files in which its result is kept.
//
//   DIR/history.csv   losses against steps, epochs and seconds
//   DIR/weights.npy   the final weights
//   DIR/network.txt   the network with these weights, for programs to load
//                     (network_file.h)
//   DIR/neurons.csv   statistics of the hidden neurons at the end; for small
//                     networks at every evaluation
//   DIR/sample_path.csv   y of one training sample at every evaluation
//   DIR/result.txt    written last: a run that has it is complete
//   DIR/checkpoint    where the run can go on, unless it converged or failed
#ifndef BIN_SUPPORT_LEARNING_RUN_H_
#define BIN_SUPPORT_LEARNING_RUN_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/neuron_statistics.h"
#include "invgrad/methods/method.h"
#include "invgrad/train/history.h"
#include "invgrad/train/train.h"
#include "problems/problem.h"

namespace invgrad {

struct LearningRunOptions {
  TrainOptions train;
  int tracked_sample = -1;  // -1: none
  std::string directory;
  // Called after every step; false stops the run. Null: nothing.
  std::function<bool(const TrainingRun& run)> on_step;
};

struct LearningRunResult {
  std::string label;
  int seed = 0;
  History history;
  TrainSummary summary;
  Eigen::VectorXd weights;
  int num_hidden_neurons = 0;
  int num_saturated = 0;

  // Neurons at history[i], where they were recorded at every evaluation.
  std::vector<std::vector<NeuronStatistics>> neurons;
  std::vector<Eigen::VectorXd> sample_path;  // y at history[i]

  bool has_failed() const { return summary.termination_type == ceres::FAILURE; }
  // The user stopped it; it may go on from its checkpoint.
  bool was_interrupted() const {
    return summary.termination_type == ceres::USER_SUCCESS;
  }
  const HistoryRow& last() const { return history.back(); }
  // Its budget ended it; with a larger one it may go on.
  bool has_used_its_budget() const {
    return summary.termination_type == ceres::NO_CONVERGENCE;
  }
  double BestTrainLoss() const;
  // Seconds until the train loss first was at most `level`; NaN if it never
  // was.
  double SecondsToLevel(double level) const;
};

// Whether a run that ended on its budget can go on with the present one.
bool HasBudgetLeft(const LearningRunResult& result,
                   const TrainOptions& options);

// Trains from `initial_weights` and writes the files. False with *error set for
// bad input or files that cannot be written.
bool RunLearning(const LearningProblem& problem,
                 const Method& method,
                 int seed,
                 const Eigen::VectorXd& initial_weights,
                 const LearningRunOptions& options,
                 LearningRunResult* result,
                 std::string* error);

// Reads back a complete run. False if there is none at `directory`, with *error
// empty, or if its files are damaged, with *error set.
bool LoadLearningRun(const std::string& directory,
                     const LearningProblem& problem,
                     LearningRunResult* result,
                     std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEARNING_RUN_H_
