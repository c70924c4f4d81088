// The runs of a sweep: of a network (learning_run.h), or a minimization
// (minimization_job.h). All are in DIR/jobs.
#ifndef BIN_SWEEP_JOB_RUN_H_
#define BIN_SWEEP_JOB_RUN_H_

#include <string>

#include "bin/support/learning_run.h"
#include "bin/support/training_flags.h"
#include "bin/sweep/plan.h"
#include "bin/sweep/results.h"

namespace invgrad {

// Of a job that trains.
LearningRunOptions OptionsOf(const SweepJob& job, const TrainingFlags& flags);

// Adds the files of the run to those of the program (run_directory.h).
bool ListJob(const SweepJob& job,
             const TrainingFlags& flags,
             std::string* error);

// The file that is written last.
std::string LastFileOf(const SweepJob& job);

// Reads the run of a job if it is done. Returns whether the job is to run: not
// if its files are damaged or of another run, which it leaves as they are.
bool LoadJob(const SweepJob& job, const TrainingFlags& flags, SweepRun* run);

// Runs a job that is to run.
void RunJob(const SweepPlan& plan,
            int number,
            const TrainingFlags& flags,
            SweepRun* run);

}  // namespace invgrad

#endif  // BIN_SWEEP_JOB_RUN_H_
