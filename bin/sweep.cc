/*
Trains by every rule at every point of a grid of settings, in parallel runs: on
the ranks of MPI (mpirun, srun), or on those that --jobs starts by mpirun.

Sample runs:

  sweep --problem=toy_network --steps=200 --jobs=2 \
    --grid="lambda=1,0.1,0.01; rule=half_inverse,adam:step_size=1e-2|3e-3"
  sweep --problem=sine --seconds=10 --tail=0.1 --jobs=2 --output=runs/sine \
    --grid="xi=1,8,32,64; phi=0,45; rule=sip:step_size=1e-2|3e-3|1e-3,
      adam:step_size=1e-2|3e-3|1e-3"
  sweep --problem=oscillator_chain --seconds=5 --output=runs/chains \
    --grid="num_oscillators=2,4; seed=1..3;
      rule=half_inverse,adam:step_size=1e-3|3e-4"
  sweep --problem=oscillator_chain --epochs=25 --output=runs/networks \
    --grid="initialization=glorot,he; hidden=20,20-20; batch_size=32,0;
      rule=half_inverse,adam:step_size=1e-3:epochs=1|5>half_inverse"

Tables and pictures show the best alternative at each point of the grid, with a
remark if it is the smallest or largest one.

  DIR/flags.txt, DIR/versions.txt    see run_directory.h
  DIR/jobs/NUMBER-SETTINGS/...       see learning_run.h
  DIR/sweep.csv                      one line a run
  DIR/table.txt, DIR/table.md        the best alternatives
  DIR/lines.png, heat_map.png, curves.png   see bin/sweep/plots.h

A second call, with any number of ranks, resumes a sweep and skips finished
runs. Ctrl-C ends the sweep and keeps the results so far. docs/clusters.md has
more.
*/

#include <algorithm>
#include <iostream>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/learning_run.h"
#include "bin/support/learning_run_files.h"
#include "bin/support/listing.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "bin/support/training_flags.h"
#include "bin/sweep/dispatch.h"
#include "bin/sweep/mpirun.h"
#include "bin/sweep/plan.h"
#include "bin/sweep/plots.h"
#include "bin/sweep/results.h"
#include "bin/sweep/schedule.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas_threads.h"
#include "report/interrupt.h"
#include "report/progress.h"

DEFINE_bool(list, false, "print the problems and methods with their options");
DEFINE_string(problem,
              "oscillator_chain",
              "name[:key=value...]: what is the same at all points");
DEFINE_string(grid,
              "",
              "\"axis=value,value; axis=value,...\": an axis is rule, seed, "
              "batch_size, hidden, activation, initialization, or an option "
              "of the problem or of the rules");
DEFINE_string(value,
              "auto",
              "what is compared: train_loss, test_loss, metric; auto: the last "
              "of these that the problem has");
DEFINE_double(tail,
              0.0,
              "share of the training time at its end over which the value is "
              "averaged; 0: the last value alone");
DEFINE_int32(
    jobs,
    1,
    "how many runs at a time, each with --threads; under mpirun or srun: "
    "one a rank");
DEFINE_int32(blas_threads, 1, "threads of the linear algebra of a run");

namespace invgrad {
namespace {

LearningRunOptions OptionsOf(const SweepJob& job) {
  LearningRunOptions options;
  options.train = TrainOptionsOfFlags(job.batch_size, job.seed);
  options.train.initial_weights = InitialWeights(*job.problem, job.seed);
  options.directory = FLAGS_output + "/jobs/" + job.name;
  return options;
}

// Reads the run of a job if it is done. Returns whether the job is to run: not
// if its files are damaged or of another run, which it leaves as they are.
bool LoadRun(const SweepJob& job, SweepRun* run) {
  LearningRunResult result;
  std::string error;
  const bool is_complete = LoadCompleteRun(
      *job.problem, job.method, OptionsOf(job), &result, &error);
  if (!error.empty()) {
    run->status = "damaged: " + error;
    Warn(job.name + ": " + run->status);
    return false;
  }
  if (!result.summary.message.empty()) run->status = result.summary.message;
  if (is_complete) run->result = std::move(result);
  return !is_complete;
}

bool RunJob(const SweepJob& job, std::string* error) {
  LearningRunOptions options = OptionsOf(job);
  options.on_step = [](const TrainingRun& /*run*/) {
    return !Interrupt::IsRequested();
  };
  LearningRunResult result;
  return RunLearning(*job.problem, job.method, options, &result, error);
}

ProgressState StateOf(const Schedule& schedule,
                      const std::vector<JobStatus>& statuses,
                      int num_skipped) {
  int num_ended = num_skipped, num_running = 0;
  std::vector<double> seconds;
  for (const JobStatus& status : statuses) {
    num_ended += status.state == JobStatus::State::kEnded ? 1 : 0;
    num_running += status.state == JobStatus::State::kRunning ? 1 : 0;
    seconds.push_back(status.seconds);
  }
  ProgressState state;
  state.label = fmt::format(
      "{}/{} done, {} running", num_ended, statuses.size(), num_running);
  state.step = ProgressState::kNoStep;
  state.fraction = schedule.FractionDone(seconds);
  return state;
}

// Runs the jobs that are not done yet, and reads all results, one a job.
std::vector<SweepRun> RunJobs(const SweepPlan& plan, Dispatcher* dispatcher) {
  std::vector<SweepRun> runs(plan.jobs.size(), {std::nullopt, "interrupted"});
  std::vector<Schedule::Job> scheduled;
  for (const SweepJob& job : plan.jobs) {
    scheduled.push_back(ScheduledJob(job, OptionsOf(job).train));
  }
  Schedule schedule(std::move(scheduled));
  int num_skipped = 0, num_done = 0;
  for (size_t i = 0; i < plan.jobs.size(); ++i) {
    if (LoadRun(plan.jobs[i], &runs[i])) continue;
    const bool is_done = runs[i].result.has_value();
    schedule.Finish(
        static_cast<int>(i),
        is_done ? runs[i].result->summary.train_time_in_seconds : 0.0);
    num_done += is_done ? 1 : 0;
    ++num_skipped;
  }
  if (num_done > 0) {
    std::cout << num_done << " of " << plan.jobs.size()
              << " runs were done before" << std::endl;
  }
  std::vector<JobStatus> statuses;
  {
    Progress::Options options;
    if (ProgramRanks() != nullptr) options.is_terminal = IsLauncherOnTerminal();
    Progress progress(options);
    statuses = dispatcher->Run(
        &schedule,
        [&](int i, std::string* why) {
          // Only this process, of all ranks, writes the list.
          return ListRunFiles(OptionsOf(plan.jobs[i]).directory, why);
        },
        [&](const std::vector<JobStatus>& now) {
          if (FLAGS_progress) {
            progress.Update(StateOf(schedule, now, num_skipped));
          }
        });
  }
  for (size_t i = 0; i < plan.jobs.size(); ++i) {
    const SweepJob& job = plan.jobs[i];
    if (statuses[i].state != JobStatus::State::kEnded) continue;
    if (statuses[i].error.empty()) {
      constexpr double kMaxSeconds = 60.0;  // until NFS shows a file
      if (NumRanks() > 1 && !Interrupt::IsRequested()) {
        WaitForFile(OptionsOf(job).directory + "/result.txt", kMaxSeconds);
      }
      LoadRun(job, &runs[i]);
    } else {
      runs[i].status = "not run: " + statuses[i].error;
      Warn(job.name + ": " + statuses[i].error);
    }
  }
  return runs;
}

bool WriteResults(const SweepPlan& plan,
                  const std::vector<SweepRun>& runs,
                  const SweepValue& value,
                  RunCounts* counts,
                  std::string* error) {
  const SweepResults results = FindBest(plan, runs, value);
  const Table table = SweepTable(results);
  std::cout << table.ToText();
  if (!WriteRunFile(FLAGS_output + "/sweep.csv", SweepCsv(results), error) ||
      !WriteTable(FLAGS_output + "/table", table, error)) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  DrawPictures({{FLAGS_output + "/lines.png", SweepLines(results)},
                {FLAGS_output + "/heat_map.png", SweepHeatMaps(results)},
                {FLAGS_output + "/curves.png", SweepCurves(results)}});
  for (const SweepRun& run : runs) {
    counts->Add(run.result.has_value() && !run.result->has_failed());
  }
  return true;
}

bool MakePlan(SweepPlan* plan, SweepValue* value, std::string* error) {
  // flags.txt has one line a flag.
  std::replace(FLAGS_grid.begin(), FLAGS_grid.end(), '\n', ' ');
  if (FLAGS_grid.empty()) {
    *error =
        "--grid is missing; for example "
        "--grid=\"rule=half_inverse,adam:step_size=1e-2|1e-3;seed=1..3\"";
    return false;
  }
  Grid grid;
  const SweepBase base{FLAGS_problem, NetworkOfFlags(), FLAGS_batch_size};
  return CheckTrainingFlags(error) &&
         CheckFlags({{"tail", {0.0, 1.0, false, true}},
                     {"jobs", {1.0, 1024.0}},
                     {"blas_threads", {1.0, 256.0}}},
                    error) &&
         ParseGrid(FLAGS_grid, &grid, error) &&
         MakeSweepPlan(base, grid, plan, error) &&
         FindSweepValue(*plan, FLAGS_value, FLAGS_tail, value, error);
}

bool Run(RunCounts* counts, std::string* error) {
  if (FLAGS_list) {
    std::cout << Listing();
    return true;
  }
  SweepPlan plan;
  SweepValue value;
  if (!AgreeOnRanks(MakePlan(&plan, &value, error), error)) return false;
  const int num_ranks =
      std::min(FLAGS_jobs, static_cast<int>(plan.jobs.size()));
  if (ProgramRanks() == nullptr && num_ranks > 1) {
    plan = SweepPlan();  // the ranks have their own
    RunByMpirun(num_ranks);
    Warn(fmt::format("--jobs={} needs {}: runs follow one another",
                     FLAGS_jobs,
                     kHasMpi ? "mpirun" : "a build with MPI"));
    if (!MakePlan(&plan, &value, error)) return false;
  }
  SetBlasThreads(FLAGS_blas_threads);
  SetDefaultBudget(*plan.jobs[0].problem);
  RunIdentity identity;
  if (std::any_of(plan.jobs.begin(), plan.jobs.end(), [](const SweepJob& job) {
        return job.method.ReadsProgress();
      })) {
    identity.AddBudget(OptionsOf(plan.jobs[0]).train);
  }
  if (!PrepareRunDirectoryOnRanks(
          ExistingDirectory::kResume, identity, error)) {
    return false;
  }
  const Interrupt interrupt(/*is_silent=*/!IsFirstRank());
  const auto run = [&plan](int job, std::string* why) {
    return RunJob(plan.jobs[job], why);
  };
  if (!IsFirstRank()) {
    ServeJobs(run);
    return true;
  }
  std::set<std::string> warned;
  for (const SweepJob& job : plan.jobs) {
    WarnOfLeftOutSamples(
        job.method, job.batch_size, job.problem->train.num_samples(), &warned);
  }
  Dispatcher dispatcher(run);
  return WriteResults(plan, RunJobs(plan, &dispatcher), value, counts, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::HandOverExitCode(invgrad::RunProgramOnRanks(
      argc,
      argv,
      "trains by every rule at every point of a grid of settings\n\n"
      "  sweep --problem=toy_network --steps=200 --jobs=2 \\\n"
      "    --grid=\"lambda=1,0.1; rule=half_inverse,adam:step_size=1e-2|1e-3\"",
      invgrad::Run));
}
