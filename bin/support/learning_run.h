// One training run, of one method from one seed, and its files.
//
//   DIR/history.csv   losses against steps, epochs and seconds
//   DIR/weights.npy   the final weights
//   DIR/network.txt   the network with these weights, for programs to load
//                     (network_file.h)
//   DIR/neurons.csv   statistics of the hidden neurons at the end; for small
//                     networks at every evaluation
//   DIR/sample_path.csv   y of one training sample at every evaluation
//   DIR/result.txt written last: marks a complete run DIR/checkpoint where the
//   run can go on, unless it converged or failed
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
  // The user stopped the run; it can resume from its checkpoint.
  bool was_interrupted() const {
    return summary.termination_type == ceres::USER_SUCCESS;
  }
  const HistoryRow& last() const { return history.back(); }
  // The budget ended the run; it can resume with a larger budget.
  bool has_used_its_budget() const {
    return summary.termination_type == ceres::NO_CONVERGENCE;
  }
  double BestTrainLoss() const;
  // Seconds until the train loss was first at most `level`; NaN if that never
  // happened.
  double SecondsToLevel(double level) const;
};

// Whether a run that ended by its budget can resume with the current budget.
bool HasBudgetLeft(const LearningRunResult& result,
                   const TrainOptions& options);

// Trains from `initial_weights` and writes the files. Returns false, with
// *error set, for bad input or if a file cannot be written.
bool RunLearning(const LearningProblem& problem,
                 const Method& method,
                 int seed,
                 const Eigen::VectorXd& initial_weights,
                 const LearningRunOptions& options,
                 LearningRunResult* result,
                 std::string* error);

// Reads a complete run. Returns false with *error empty if there is none in
// `directory`, and with *error set if its files are damaged.
bool LoadLearningRun(const std::string& directory,
                     const LearningProblem& problem,
                     LearningRunResult* result,
                     std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEARNING_RUN_H_
