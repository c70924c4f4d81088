// One training run, of one method from one seed, and its files.
//
//   DIR/history.csv       losses against steps, epochs and seconds
//   DIR/weights.npy       the final weights
//   DIR/network.txt       the network with these weights, for programs to load
//                         (dense_network.h)
//   DIR/neurons.csv       statistics of the hidden neurons at the end; for
//                         small networks at every evaluation
//   DIR/sample_path.csv   y of one training sample at every evaluation
//   DIR/result.txt        written last: marks a complete run; with the run's
//                         identity and digests of history and weights
//   DIR/checkpoint        where the run can go on, unless it converged or
//                         failed
#ifndef BIN_SUPPORT_LEARNING_RUN_H_
#define BIN_SUPPORT_LEARNING_RUN_H_

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/neuron_statistics.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"
#include "invgrad/train.h"
#include "report/table.h"

namespace invgrad {

// Makes the problem of a specification. Returns false, with *error, if it is
// invalid or has no network.
bool CreateLearningProblem(const std::string& specification,
                           LearningProblem* problem,
                           std::string* error);

// 0 for a network that is not a DenseNetwork.
int NumHiddenNeurons(const Network& network);

// The weights that every method starts from at `seed`.
Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed);

// The batch size of phases without their own, at least 1. `flag_batch_size`:
// --batch_size, or -1 for the problem's.
int BatchSize(const LearningProblem& problem, int flag_batch_size);

// Returns false if a batch size does not fit the data, or if the data are not
// finite; *error names flag, value and allowed values.
bool CheckBatches(const LearningProblem& problem,
                  const std::vector<Method>& methods,
                  int flag_batch_size,
                  std::string* error);

// Warns of phases whose batches do not divide the samples, with the divisors
// near; not of what is in *warned. Ceres' minimizers use all samples.
void WarnOfLeftOutSamples(const Method& method,
                          int batch_size,
                          int num_samples,
                          std::set<std::string>* warned);

struct LearningRunOptions {
  // With initial weights and a budget. If it has ranks, the first one writes
  // the files.
  TrainOptions train;
  int tracked_sample = -1;  // -1: none
  std::string directory;
  // Called after every step; false on any rank stops the run. Null: nothing.
  std::function<bool(const TrainingRun& run)> on_step;
};

struct LearningRunResult : TrainResult {
  std::string label;
  int seed = 0;
  int num_saturated = 0;
  // Neurons at history[i], where they were recorded at every evaluation.
  std::vector<std::vector<NeuronStatistics>> neurons;
  std::vector<Eigen::VectorXd> sample_path;  // y at history[i]

  bool has_failed() const { return summary.termination_type == ceres::FAILURE; }
  const HistoryRow& last() const { return history.back(); }
  double BestTrainLoss() const;
  // Seconds until the train loss was first at most `level`; NaN if that never
  // happened.
  double SecondsToLevel(double level) const;
  // NaN before the first step.
  double MillisecondsPerStep() const;
};

// Trains, or goes on from a checkpoint, and writes the files. Returns false,
// with *error set, for bad input, a checkpoint of another run, or if a file
// cannot be written.
bool RunLearning(const LearningProblem& problem,
                 const Method& method,
                 const LearningRunOptions& options,
                 LearningRunResult* result,
                 std::string* error);

// Reads the run in the directory. Returns true if the run is complete: its
// result exists, and it did not end by a budget that is now larger. Returns
// false, with *error empty, if the run must start or resume; *result then holds
// the existing part. *error is not empty if the files are damaged or of another
// run.
bool LoadCompleteRun(const LearningProblem& problem,
                     const Method& method,
                     const LearningRunOptions& options,
                     LearningRunResult* result,
                     std::string* error);

// Adds the columns steps, s and ms/step; "-" for null.
void AddTimes(const LearningRunResult* run, Table* table);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEARNING_RUN_H_
