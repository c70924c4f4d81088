/*
Trains by every rule at every point of a grid of settings.

Sample runs:

  sweep --problem=toy_network --steps=200 \
    --grid="lambda=1,0.1,0.01; rule=half_inverse,adam:step_size=1e-2|3e-3"
  sweep --problem=sine --seconds=10 --tail=0.1 --output=runs/sine \
    --grid="xi=1,8,32,64; phi=0,45; rule=sip:step_size=1e-2|3e-3|1e-3,
      adam:step_size=1e-2|3e-3|1e-3"
  sweep --problem=oscillator_chain --epochs=25 --output=runs/networks \
    --grid="initialization=glorot,he; hidden=20,20-20; batch_size=32,0;
      rule=half_inverse,adam:step_size=1e-3:epochs=1|5>half_inverse"

One run follows the other; a second call goes on with what is missing. With
--list_jobs it prints a command for each run instead, which GNU parallel runs,
on one machine or many; then --collect makes tables and pictures. On the ranks
of mpirun each takes the next run of the list in turn. docs/clusters.md.

Tables and pictures show the best alternative at each point of the grid, with a
remark if it is the smallest or largest one.

  DIR/flags.txt, DIR/versions.txt    see run_directory.h
  DIR/jobs/NUMBER-SETTINGS/...       see learning_run.h
  DIR/sweep.csv                      one line a run
  DIR/table.txt, DIR/table.md        the best alternatives
  DIR/lines.png, heat_map.png, curves.png   see bin/sweep/plots.h
*/

#include <algorithm>
#include <iostream>
#include <optional>
#include <set>
#include <sstream>
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
#include "bin/sweep/plan.h"
#include "bin/sweep/plots.h"
#include "bin/sweep/results.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/blas_threads.h"
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
DEFINE_bool(list_jobs,
            false,
            "print a command for each run, for GNU parallel, and run nothing");
DEFINE_int32(job, -1, "only the run with this number, as --list_jobs says");
DEFINE_bool(collect, false, "only tables and pictures, of the runs so far");
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
    return false;
  }
  if (!result.summary.message.empty()) run->status = result.summary.message;
  if (is_complete) run->result = std::move(result);
  return !is_complete;
}

// Runs a job, or goes on with it. Returns false, with *error, if it cannot.
bool RunJob(const SweepPlan& plan, int number, std::string* error) {
  const SweepJob& job = plan.jobs[number];
  LearningRunOptions options = OptionsOf(job);
  Progress progress;
  ProgressState state;
  state.label = fmt::format("{}/{} {}", number + 1, plan.jobs.size(), job.name);
  options.on_step = [&](const TrainingRun& run) {
    state.step = run.step();
    state.loss = run.history().back().train_loss;
    state.epoch = run.epoch();
    state.fraction = run.progress();
    return ShowProgress(state, &progress);
  };
  LearningRunResult result;
  return RunLearning(*job.problem, job.method, options, &result, error);
}

// "'sweep' '--steps=200' '--job=3'": for a shell.
std::string JobCommand(int number) {
  std::string command;
  std::vector<std::string> words = gflags::GetArgvs();
  words.push_back(fmt::format("--job={}", number));
  for (const std::string& word : words) {
    if (word.find("-list_jobs") <= 1) continue;
    command += command.empty() ? "'" : " '";
    for (const char c : word) {
      command += c == '\'' ? "'\\''" : c == '\n' ? " " : std::string(1, c);
    }
    command += "'";
  }
  return command;
}

// The files of all runs, before other processes write some of them.
bool ListFiles(const SweepPlan& plan, std::string* error) {
  return std::all_of(
      plan.jobs.begin(), plan.jobs.end(), [error](const SweepJob& job) {
        return ListRunFiles(OptionsOf(job).directory, error);
      });
}

// Runs what is not done yet of this rank's jobs, each rank every NumRanks()th.
// Returns a line a job, "NUMBER why" if it could not run, otherwise "NUMBER ".
std::string RunJobs(const SweepPlan& plan) {
  const int num_jobs = static_cast<int>(plan.jobs.size());
  const int first = ProgramRanks() == nullptr ? 0 : ProgramRanks()->rank();
  std::string ended;
  for (int i = first; i < num_jobs; i += NumRanks()) {
    SweepRun run;
    if (Interrupt::IsRequested() || !LoadRun(plan.jobs[i], &run)) continue;
    std::string error;
    if (RunJob(plan, i, &error)) error.clear();
    std::replace(error.begin(), error.end(), '\n', ' ');
    ended += fmt::format("{} {}\n", i, error);
  }
  return ended;
}

// The runs that are there, one a job; `missing`: what the others are.
std::vector<SweepRun> LoadRuns(const SweepPlan& plan,
                               const std::string& missing) {
  std::vector<SweepRun> runs(plan.jobs.size(), {std::nullopt, missing});
  for (size_t i = 0; i < plan.jobs.size(); ++i) LoadRun(plan.jobs[i], &runs[i]);
  return runs;
}

// Runs all jobs on all ranks. Returns their results, on rank 0.
std::vector<SweepRun> RunAll(const SweepPlan& plan) {
  if (IsFirstRank()) {
    std::set<std::string> warned;
    for (const SweepJob& job : plan.jobs) {
      const int num_samples = job.problem->train.num_samples();
      WarnOfLeftOutSamples(job.method, job.batch_size, num_samples, &warned);
    }
    const std::vector<SweepRun> before = LoadRuns(plan, "");
    const auto num_done =
        std::count_if(before.begin(), before.end(), [](const SweepRun& run) {
          return run.result.has_value();
        });
    if (num_done > 0) {
      std::cout << num_done << " of " << before.size()
                << " runs were done before" << std::endl;
    }
  }
  std::vector<std::string> ended = {RunJobs(plan)};
  if (NumRanks() > 1) {
    WaitForRanks();
    ended = ProgramRanks()->GatherTexts(ended[0]);
  }
  if (!IsFirstRank()) return {};
  std::vector<std::string> failures(plan.jobs.size());
  for (const std::string& of_rank : ended) {
    std::istringstream lines(of_rank);
    int i = 0;
    for (std::string why; lines >> i && std::getline(lines, why);) {
      failures[i] = why.substr(1);
      constexpr double kMaxSeconds = 60.0;  // until NFS shows a file
      if (failures[i].empty() && NumRanks() > 1 && !Interrupt::IsRequested()) {
        WaitForFile(OptionsOf(plan.jobs[i]).directory + "/result.txt",
                    kMaxSeconds);
      }
    }
  }
  if (Interrupt::IsRequested()) {
    Warn("the same command goes on with what is missing");
  }
  std::vector<SweepRun> runs = LoadRuns(plan, "interrupted");
  for (size_t i = 0; i < runs.size(); ++i) {
    if (!failures[i].empty()) runs[i].status = "not run: " + failures[i];
  }
  return runs;
}

bool WriteResults(const SweepPlan& plan,
                  const std::vector<SweepRun>& runs,
                  const SweepValue& value,
                  RunCounts* counts,
                  std::string* error) {
  for (size_t i = 0; i < runs.size(); ++i) {
    const bool is_there = runs[i].result.has_value();
    counts->Add(is_there && !runs[i].result->has_failed());
    if (!is_there && !Interrupt::IsRequested()) {
      Warn(plan.jobs[i].name + ": " + runs[i].status);
    }
  }
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
  const int num_chosen = (FLAGS_list_jobs ? 1 : 0) + (FLAGS_collect ? 1 : 0) +
                         (FLAGS_job >= 0 ? 1 : 0);
  if (num_chosen > (NumRanks() > 1 ? 0 : 1)) {
    *error =
        "--list_jobs, --job and --collect: one of them, and without mpirun";
    return false;
  }
  Grid grid;
  const SweepBase base{FLAGS_problem, NetworkOfFlags(), FLAGS_batch_size};
  if (!CheckTrainingFlags(error) ||
      !CheckFlags(
          {{"tail", {0.0, 1.0, false, true}}, {"blas_threads", {1.0, 256.0}}},
          error) ||
      !ParseGrid(FLAGS_grid, &grid, error) ||
      !MakeSweepPlan(base, grid, plan, error)) {
    return false;
  }
  const double last_job = static_cast<double>(plan->jobs.size()) - 1.0;
  return CheckFlags({{"job", {-1.0, last_job}}}, error) &&
         FindSweepValue(*plan, FLAGS_value, FLAGS_tail, value, error);
}

// One run, in a directory that --list_jobs has prepared.
void RunOne(const SweepPlan& plan, RunCounts* counts) {
  SweepRun run;
  const SweepJob& job = plan.jobs[FLAGS_job];
  std::string why;
  if (LoadRun(job, &run)) {
    if (!RunJob(plan, FLAGS_job, &why)) run.status = "not run: " + why;
    if (why.empty()) LoadRun(job, &run);
  }
  if (!run.result.has_value()) {
    Warn(job.name + ": " + run.status);
    counts->Add(false);
    return;
  }
  counts->Add(!run.result->has_failed());
  std::cout << job.name << ": " << run.status << "\n";
}

bool Run(RunCounts* counts, std::string* error) {
  if (FLAGS_list) {
    std::cout << Listing();
    return true;
  }
  SweepPlan plan;
  SweepValue value;
  if (!AgreeOnRanks(MakePlan(&plan, &value, error), error)) return false;
  SetBlasThreads(FLAGS_blas_threads);
  SetDefaultBudget(*plan.jobs[0].problem);
  RunIdentity identity;
  if (std::any_of(plan.jobs.begin(), plan.jobs.end(), [](const SweepJob& job) {
        return job.method.ReadsProgress();
      })) {
    identity.AddBudget(OptionsOf(plan.jobs[0]).train);
  }
  const bool is_part = FLAGS_job >= 0 || FLAGS_collect;
  if (is_part ? !NameFlag(FLAGS_collect ? "collect" : "job",
                          JoinRunDirectory(identity, error),
                          error)
              : !PrepareRunDirectoryOnRanks(
                    ExistingDirectory::kResume, identity, error)) {
    return false;
  }
  const Interrupt interrupt(/*is_silent=*/!IsFirstRank());
  if (FLAGS_job >= 0) {
    RunOne(plan, counts);
    return true;
  }
  if (!is_part &&
      !AgreeOnRanks(!IsFirstRank() || ListFiles(plan, error), error)) {
    return false;
  }
  if (FLAGS_list_jobs) {
    for (size_t i = 0; i < plan.jobs.size(); ++i) {
      std::cout << JobCommand(static_cast<int>(i)) << "\n";
    }
    return true;
  }
  const std::vector<SweepRun> runs =
      FLAGS_collect ? LoadRuns(plan, "not run") : RunAll(plan);
  return !IsFirstRank() || WriteResults(plan, runs, value, counts, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgramOnRanks(
      argc,
      argv,
      "trains by every rule at every point of a grid of settings\n\n"
      "  sweep --problem=toy_network --steps=200 \\\n"
      "    --grid=\"lambda=1,0.1; rule=half_inverse,adam:step_size=1e-2|1e-3\"",
      invgrad::Run);
}
