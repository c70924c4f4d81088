// All methods on a learning problem, from all seeds: table, CSV and pictures.
//
//   DIR/METHOD-seedK/...   see bin/support/learning_run.h
//   DIR/initial_weights-seedK.npy, DIR/data.npy
//   DIR/table.txt, DIR/table.md, DIR/summary.csv
//   DIR/loss.png, neurons.png, map.png, sample_path.png: learning_plots.h
//
// The table shows the median over the seeds of a method for each column; curves
// and times show the run with the median final train loss. A failed run counts
// as worst.
#ifndef BIN_COMPARE_LEARNING_COMPARISON_H_
#define BIN_COMPARE_LEARNING_COMPARISON_H_

#include <ostream>
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
  std::vector<double> levels;  // the table shows the times to reach these
                               // losses
  int batch_size = -1;         // see BatchSize in bin/support/training.h
  int tracked_sample = -1;
  bool resume = false;
  TrainOptions train;
};

// A method from all seeds.
struct MethodResults {
  std::string label;
  std::string refusal;  // why there are no runs
  std::vector<LearningRunResult> runs;

  // The run with the median of this final loss.
  const LearningRunResult& MedianRun(
      double HistoryRow::*loss = &HistoryRow::train_loss) const;
};

// Returns false if batch sizes or the tracked sample do not fit the data;
// *error names flag, value and allowed values.
bool CheckLearningComparison(const LearningProblem& problem,
                             const std::vector<Method>& methods,
                             const LearningComparisonOptions& options,
                             std::string* error);

// Runs everything and prints the table to `out`. `initial_weights`, if not
// empty, replace the initial weights of every seed. Returns false if results
// cannot be written, or if no method could run.
bool CompareLearning(const LearningProblem& problem,
                     const std::vector<Method>& methods,
                     const LearningComparisonOptions& options,
                     const Eigen::VectorXd& initial_weights,
                     std::ostream& out,
                     std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_LEARNING_COMPARISON_H_
