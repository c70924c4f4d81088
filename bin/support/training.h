// The common part of training runs in compare, sweep and bench_training: start,
// batches, and resuming.
#ifndef BIN_SUPPORT_TRAINING_H_
#define BIN_SUPPORT_TRAINING_H_

#include <set>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/learning_run.h"
#include "invgrad/methods/method.h"
#include "problems/problem.h"
#include "report/table.h"

namespace invgrad {

// The weights that every method starts from at `seed`.
Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed);

// The default batch size of phases: --batch_size, or -1 for the problem's.
int BatchSize(const LearningProblem& problem, int flag_batch_size);

// The batch size of a phase.
int BatchSize(const LearningProblem& problem,
              const Phase& phase,
              int flag_batch_size);

// Returns false if a batch size does not fit the data, or if the data are not
// finite; *error names flag, value and allowed values.
bool CheckBatches(const LearningProblem& problem,
                  const std::vector<Method>& methods,
                  int flag_batch_size,
                  std::string* error);

// Adds "batch_size=100: 96 of 4096 samples are left out of every epoch;
// divisors near: 64, 128" for each phase whose batches do not divide the
// samples. `batch_size`, at least 1: the default of phases. Ceres' minimizers
// use all samples.
void AddLeftOutSamples(const Method& method,
                       int batch_size,
                       int num_samples,
                       std::set<std::string>* warnings);

// Reads the run in the directory. Returns true if the run is complete: its
// result exists, and it did not end by a budget that is now larger. Returns
// false, with *error empty, if the run must start or resume; *result then holds
// the existing part.
bool LoadCompleteRun(const std::string& directory,
                     const LearningProblem& problem,
                     const TrainOptions& options,
                     LearningRunResult* result,
                     std::string* error);

// NaN before the first step.
double MillisecondsPerStep(const LearningRunResult& run);

// Adds the columns steps, s and ms/step, of a run that `is_there`.
void AddTimes(const LearningRunResult& run, bool is_there, Table* table);

}  // namespace invgrad

#endif  // BIN_SUPPORT_TRAINING_H_
