#include "bin/sweep/job_run.h"

#include <utility>

#include "bin/support/learning_run_files.h"
#include "bin/support/live_run.h"
#include "bin/support/run_output.h"
#include "bin/sweep/minimization_job.h"
#include "fmt/core.h"
#include "report/progress.h"

namespace invgrad {
namespace {

// Trains, or goes on with it.
bool RunTraining(const SweepJob& job,
                 const TrainingFlags& flags,
                 const std::string& label,
                 LearningRunResult* result,
                 std::string* error) {
  LearningRunOptions options = OptionsOf(job, flags);
  Progress progress;
  ProgressState state;
  state.label = label;
  state.step = ProgressState::kNoStep;
  ShowProgress(state, &progress);  // the first step may take long
  options.on_step = [&](const TrainingRun& training) {
    state.step = training.step();
    state.loss = training.history().back().train_loss;
    state.epoch = training.epoch();
    state.fraction = training.progress();
    return ShowProgress(state, &progress);
  };
  return RunLearning(job.learning(), job.method, options, result, error);
}

}  // namespace

LearningRunOptions OptionsOf(const SweepJob& job, const TrainingFlags& flags) {
  LearningRunOptions options;
  options.train = flags.Options(job.batch_size, job.seed);
  options.train.initial_weights = InitialWeights(job.learning(), job.seed);
  options.directory = InOutput("jobs/" + job.name);
  return options;
}

bool ListJob(const SweepJob& job,
             const TrainingFlags& flags,
             std::string* error) {
  return job.is_training()
             ? ListRunFiles(OptionsOf(job, flags).directory, error)
             : ListMinimizationJob(job, error);
}

std::string LastFileOf(const SweepJob& job) {
  return InOutput(
      "jobs/" + job.name + "/" +
      (job.is_training() ? "result.txt" : FileName(job.method.label) + ".run"));
}

bool LoadJob(const SweepJob& job, const TrainingFlags& flags, SweepRun* run) {
  LearningRunResult result;
  std::string error;
  const bool is_complete = job.is_training()
                               ? LoadCompleteRun(job.learning(),
                                                 job.method,
                                                 OptionsOf(job, flags),
                                                 &result,
                                                 &error)
                               : RunOrReadMinimization(job,
                                                       flags,
                                                       /*may_run=*/false,
                                                       &result,
                                                       &error);
  if (!error.empty()) {
    run->status = "damaged: " + error;
    return false;
  }
  if (!result.summary.message.empty()) run->status = result.summary.message;
  if (is_complete) run->result = std::move(result);
  return !is_complete;
}

void RunJob(const SweepPlan& plan,
            int number,
            const TrainingFlags& flags,
            SweepRun* run) {
  const SweepJob& job = plan.jobs[number];
  const std::string label =
      fmt::format("{}/{} {}", number + 1, plan.jobs.size(), job.name);
  LearningRunResult result;
  std::string error;
  const bool has_run = job.is_training()
                           ? RunTraining(job, flags, label, &result, &error)
                           : RunOrReadMinimization(job,
                                                   flags,
                                                   /*may_run=*/true,
                                                   &result,
                                                   &error);
  if (!has_run) {
    run->status = "not run: " + error;
    return;
  }
  if (result.summary.termination_type == ceres::USER_SUCCESS) {
    run->status = "interrupted";  // to go on with
    return;
  }
  run->status = result.summary.message;
  run->result = std::move(result);
}

}  // namespace invgrad
