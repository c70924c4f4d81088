// A run of a sweep over a problem without a network.
//
//   DIR/jobs/NAME/METHOD.*   of a least-squares problem (estimation_run.h), or
//                            of a point problem (point_run.h)
//
// The seed is that of the start of a least-squares problem; a point problem has
// one start.
#ifndef BIN_SWEEP_MINIMIZATION_JOB_H_
#define BIN_SWEEP_MINIMIZATION_JOB_H_

#include <string>

#include "bin/support/learning_run.h"
#include "bin/support/training_flags.h"
#include "bin/sweep/plan.h"

namespace invgrad {

// Adds the files of the run to those of the program (run_directory.h).
bool ListMinimizationJob(const SweepJob& job, std::string* error);

// Reads the run if it is done; otherwise, and if may_run, runs it. The result has
// the costs as train losses. Returns false if there is no result, with the
// reason in *why; empty: the run is not there.
bool RunOrReadMinimization(const SweepJob& job,
                           const TrainingFlags& flags,
                           bool may_run,
                           LearningRunResult* result,
                           std::string* why);

}  // namespace invgrad

#endif  // BIN_SWEEP_MINIMIZATION_JOB_H_
