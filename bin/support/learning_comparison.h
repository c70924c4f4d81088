// All methods on a learning problem, from all seeds: table, CSV and pictures.
//
//   DIR/METHOD-seedK/...   see learning_run.h
//   DIR/initial_weights-seedK.npy, DIR/data.npy
//   DIR/table.txt, DIR/table.md, DIR/summary.csv
//   DIR/loss.png           losses against steps and against seconds; the
//                          problem's metric, if it has one
//   DIR/neurons.png        mean activations of a small network's neurons
//   DIR/map.png            x over the input, where both are one number
//   DIR/sample_path.png    the tracked sample in the plane of y_0 and y_1
//
// Of a method's seeds, the table shows the median of each column, and curves
// and times show the run with the median final train loss; a failed run counts
// as worse than any other.
#ifndef BIN_SUPPORT_LEARNING_COMPARISON_H_
#define BIN_SUPPORT_LEARNING_COMPARISON_H_

#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/learning_run.h"
#include "invgrad/methods/method.h"
#include "problems/problem.h"

namespace invgrad {

struct LearningComparisonOptions {
  std::string output;
  std::vector<int> seeds;
  std::vector<double> levels;
  int batch_size = -1;  // -1: the problem's; a method's own goes first
  int tracked_sample = -1;
  bool resume = false;
  bool plots = true;
  bool shows_progress = true;
  TrainOptions train;
};

// False, with *error naming flag, value and what is allowed, if batch sizes or
// the tracked sample do not fit the data.
bool CheckLearningComparison(const LearningProblem& problem,
                             const std::vector<Method>& methods,
                             const LearningComparisonOptions& options,
                             std::string* error);

// The weights that every method starts from at `seed`.
Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed);

// The batch size of methods without one of their own: the command line's, or
// the problem's.
int BatchSize(const LearningProblem& problem,
              const LearningComparisonOptions& options);

// The batch size of a method, or of one of its phases.
int BatchSize(const LearningProblem& problem,
              const Phase& phase,
              const LearningComparisonOptions& options);

// What a user should know about a batch size that does not divide the number of
// samples: "batch_size=100: 96 of 4096 samples are left out of every epoch;
// divisors near: 64, 128". Empty if it does.
std::string LeftOutSamples(int batch_size, int num_samples);

// Adds what LeftOutSamples says of each phase of the method. `batch_size`, at
// least 1: of phases without one of their own; Ceres' minimizers take all
// samples.
void AddLeftOutSamples(const Method& method,
                       int batch_size,
                       int num_samples,
                       std::set<std::string>* warnings);

// Runs everything and prints the table to `out`. `initial_weights`, if not
// empty, replace those of every seed. False if results cannot be written.
bool CompareLearning(const LearningProblem& problem,
                     const std::vector<Method>& methods,
                     const LearningComparisonOptions& options,
                     const Eigen::VectorXd& initial_weights,
                     std::ostream& out,
                     std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEARNING_COMPARISON_H_
