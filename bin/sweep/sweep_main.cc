// The program sweep: every method at every point of a grid of settings. One run
// follows the other; a second call goes on with what is missing. On the ranks of
// mpirun each takes the next run of the list in turn.

#include <algorithm>
#include <iostream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/flags.h"
#include "bin/support/html_output.h"
#include "bin/support/learning_run.h"
#include "bin/support/listing.h"
#include "bin/support/output_options.h"
#include "bin/support/point_run.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "bin/support/training_flags.h"
#include "bin/sweep/job_run.h"
#include "bin/sweep/plan.h"
#include "bin/sweep/plots.h"
#include "bin/sweep/report.h"
#include "bin/sweep/results.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/blas_threads.h"
#include "invgrad/compare/compare.h"
#include "report/interrupt.h"

namespace invgrad {
namespace {

// What a sweep is. Its flags are the fields.
struct SweepOptions {
  bool list = false;
  std::string problem;
  std::string grid;
  std::string value = "auto";
  double tail = 0.0;
  bool list_jobs = false;
  int job = -1;
  bool collect = false;
  int blas_threads = 1;
  TrainingFlags training;

  void AddFlags();
};

// For gflags, until the program ends.
SweepOptions& Options() {
  static auto& options = *new SweepOptions;
  return options;
}

void SweepOptions::AddFlags() {
  AddFlag("list", &list, "print the problems and methods with their options");
  AddFlag("problem",
          &problem,
          "name[:key=value...]: what is the same at all points");
  AddFlag("grid",
          &grid,
          "\"axis=value,value; axis=value,...\": an axis is rule, seed, "
          "batch_size, hidden, activation, initialization, torch_script, "
          "or an option of the problem or of the rules");
  AddFlag("value",
          &value,
          "what is compared: train_loss, test_loss, metric; auto: the last "
          "of these that the problem has");
  AddFlag("tail",
          &tail,
          "share of the training time at its end over which the value is "
          "averaged; 0: the last value alone");
  AddFlag("list_jobs",
          &list_jobs,
          "print a command for each run, for GNU parallel, and run nothing");
  AddFlag("job", &job, "only the run with this number, as --list_jobs says");
  AddFlag("collect", &collect, "only tables and pictures, of the runs so far");
  AddFlag(
      "blas_threads", &blas_threads, "threads of the linear algebra of a run");
  training.Add();
  AddOutputFlags();
}

// "sweep --steps=200 --job=3": for a shell.
std::string JobCommand(int number) {
  std::string command;
  std::vector<std::string> words = gflags::GetArgvs();
  const bool has_flag_file =
      std::any_of(words.begin(), words.end(), [](const std::string& word) {
        return word.find("-flagfile") <= 1;
      });
  words.push_back(fmt::format("--job={}", number));
  for (const std::string& word : words) {
    if (word.find("-list_jobs") <= 1) continue;
    command += (command.empty() ? "" : " ") + QuoteForShell(word);
  }
  if (has_flag_file) command += " --nolist_jobs";  // which may be in the file
  return command;
}

// The files of all runs, before other processes write some of them.
bool ListFiles(const SweepPlan& plan, std::string* error) {
  return std::all_of(
      plan.jobs.begin(), plan.jobs.end(), [error](const SweepJob& job) {
        return ListJob(job, Options().training, error);
      });
}

// The runs that are there, one a job; `missing`: what the others are.
std::vector<SweepRun> LoadRuns(const SweepPlan& plan,
                               const std::string& missing) {
  std::vector<SweepRun> runs(plan.jobs.size(), {std::nullopt, missing});
  for (size_t i = 0; i < runs.size(); ++i) {
    LoadJob(plan.jobs[i], Options().training, &runs[i]);
  }
  return runs;
}

// What a user should know before the runs.
void PrintBefore(const SweepPlan& plan) {
  std::set<std::string> warned;
  for (const SweepJob& job : plan.jobs) {
    if (!job.is_training()) continue;
    const int num_samples = job.learning().train.num_samples();
    WarnOfLeftOutSamples(job.method, job.batch_size, num_samples, &warned);
  }
  const std::vector<SweepRun> before = LoadRuns(plan, "");
  const auto num_done =
      std::count_if(before.begin(), before.end(), [](const SweepRun& run) {
        return run.result.has_value();
      });
  if (num_done > 0) {
    std::cout << num_done << " of " << before.size() << " runs were done before"
              << std::endl;
  }
}

// On rank 0, adds the runs of the other ranks, from their files.
void CollectFromRanks(const SweepPlan& plan, std::vector<SweepRun>* runs) {
  WaitForRanks();
  // A line a job, "+" if there is a result, and the status.
  std::string own;
  for (const SweepRun& run : *runs) {
    std::string status = run.status;
    std::replace(status.begin(), status.end(), '\n', ' ');
    own += (run.result.has_value() ? '+' : '-') + status + '\n';
  }
  const std::vector<std::string> texts = ProgramRanks()->GatherTexts(own);
  if (!IsFirstRank()) return;
  for (size_t rank = 1; rank < texts.size(); ++rank) {
    std::istringstream lines(texts[rank]);
    std::string line;
    for (size_t i = 0; std::getline(lines, line); ++i) {
      if (i % texts.size() != rank) continue;
      (*runs)[i].status = line.substr(1);
      if (line[0] == '-') continue;
      constexpr double kMaxSeconds = 60.0;  // until NFS shows a file
      WaitForFile(LastFileOf(plan.jobs[i]), kMaxSeconds);
      LoadJob(plan.jobs[i], Options().training, &(*runs)[i]);
    }
  }
}

// Runs what is not done yet, each rank every NumRanks()th job. Returns the
// runs, one a job; rank 0 has all of them.
std::vector<SweepRun> RunAll(const SweepPlan& plan, const SweepValue& value) {
  if (IsFirstRank()) PrintBefore(plan);
  std::vector<SweepRun> runs(plan.jobs.size(), {std::nullopt, "interrupted"});
  LiveReport live;
  const auto make_report = [&] {
    return SweepReport(FindBest(plan, LoadRuns(plan, ""), value),
                       {},
                       {},
                       Options().training.BudgetText(),
                       /*is_over=*/false);
  };
  const int first = ProgramRanks() == nullptr ? 0 : ProgramRanks()->rank();
  for (size_t i = first; i < runs.size(); i += NumRanks()) {
    if (LoadJob(plan.jobs[i], Options().training, &runs[i]) &&
        !Interrupt::IsRequested()) {
      if (IsFirstRank()) live.Update(make_report);
      RunJob(plan, static_cast<int>(i), Options().training, &runs[i]);
    }
  }
  if (NumRanks() > 1) CollectFromRanks(plan, &runs);
  if (IsFirstRank() && Interrupt::IsRequested()) {
    Warn("the same command goes on with what is missing");
  }
  return runs;
}

bool Report(const SweepPlan& plan,
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
  if (!WriteRunFile(InOutput("sweep.csv"), SweepCsv(results), error) ||
      !WriteTable(InOutput("table"), table, error)) {
    return false;
  }
  std::cout << "results in " << Output().output << "\n";
  const std::vector<Plot> lines = SweepLines(results);
  const std::vector<Plot> maps = SweepHeatMaps(results);
  FinishReport(SweepReport(results,
                           lines,
                           maps,
                           Options().training.BudgetText(),
                           /*is_over=*/true),
               {{InOutput("lines.png"), lines},
                {InOutput("heat_map.png"), maps},
                {InOutput("curves.png"), SweepCurves(results)}});
  return true;
}

// Checks the options, and makes the plan of them.
bool Check(SweepOptions* options,
           SweepPlan* plan,
           SweepValue* value,
           std::string* error) {
  if (options->grid.empty()) {
    *error =
        "--grid is missing; for example "
        "--grid=\"rule=half_inverse,adam:step_size=1e-2|1e-3;seed=1..3\"";
    return false;
  }
  const int num_chosen = (options->list_jobs ? 1 : 0) +
                         (options->collect ? 1 : 0) +
                         (options->job >= 0 ? 1 : 0);
  if (num_chosen > (NumRanks() > 1 ? 0 : 1)) {
    *error =
        "--list_jobs, --job and --collect: one of them, and without mpirun";
    return false;
  }
  Grid grid;
  const SweepBase base{options->problem,
                       options->training.network,
                       options->training.batch_size};
  if (!options->training.Check(error) ||
      !CheckFlags(
          {{"tail", {0.0, 1.0, false, true}}, {"blas_threads", {1.0, 256.0}}},
          error) ||
      !ParseGrid(options->grid, &grid, error) ||
      !MakeSweepPlan(base, grid, plan, error)) {
    return false;
  }
  const PhysicsProblem& problem = *plan->jobs[0].problem;
  if (problem.learning.has_value()) {
    options->training.SetDefaultBudget(*problem.learning);
  } else if (!CheckNoTraining(problem.least_squares.has_value(), error)) {
    return false;
  } else if (options->training.steps == 0 && options->training.seconds == 0.0) {
    options->training.steps = problem.least_squares.has_value()
                                  ? problem.least_squares->max_num_iterations
                                  : PointBudget().max_num_iterations;
  }
  const double last_job = static_cast<double>(plan->jobs.size()) - 1.0;
  return CheckFlags({{"job", {-1.0, last_job}}}, error) &&
         FindSweepValue(*plan, options->value, options->tail, value, error);
}

// Prepares the directory, or joins that of which this process makes a part.
bool Prepare(const SweepOptions& options,
             const SweepPlan& plan,
             std::string* error) {
  RunIdentity identity;
  if (plan.jobs[0].is_training() &&
      std::any_of(plan.jobs.begin(), plan.jobs.end(), [](const SweepJob& job) {
        return job.method.ReadsProgress();
      })) {
    identity.AddBudget(OptionsOf(plan.jobs[0], options.training).train);
  }
  if (options.job >= 0 || options.collect) {
    return NameFlag(options.collect ? "collect" : "job",
                    JoinRunDirectory(identity, error),
                    error);
  }
  return PrepareRunDirectoryOnRanks(
             ExistingDirectory::kResume, identity, error) &&
         AgreeOnRanks(!IsFirstRank() || ListFiles(plan, error), error);
}

// One run, in a directory that --list_jobs has prepared.
void RunOne(const SweepPlan& plan, int number, RunCounts* counts) {
  SweepRun run;
  const SweepJob& job = plan.jobs[number];
  const TrainingFlags& flags = Options().training;
  if (LoadJob(job, flags, &run)) RunJob(plan, number, flags, &run);
  counts->Add(run.result.has_value() && !run.result->has_failed());
  if (run.result.has_value()) {
    std::cout << job.name << ": " << run.status << "\n";
  } else {
    Warn(job.name + ": " + run.status);
  }
}

bool Run(RunCounts* counts, std::string* error) {
  SweepOptions& options = Options();
  if (options.list) {
    std::cout << Listing();
    return true;
  }
  SweepPlan plan;
  SweepValue value;
  if (!AgreeOnRanks(Check(&options, &plan, &value, error), error)) {
    return false;
  }
  SetBlasThreads(options.blas_threads);
  if (!Prepare(options, plan, error)) return false;
  const Interrupt interrupt(/*is_silent=*/!IsFirstRank());
  if (options.job >= 0) {
    RunOne(plan, options.job, counts);
    return true;
  }
  if (options.list_jobs) {
    for (size_t i = 0; i < plan.jobs.size(); ++i) {
      std::cout << JobCommand(static_cast<int>(i)) << "\n";
    }
    return true;
  }
  const std::vector<SweepRun> runs =
      options.collect ? LoadRuns(plan, "not run") : RunAll(plan, value);
  return !IsFirstRank() || Report(plan, runs, value, counts, error);
}

}  // namespace

int SweepMain(int argc, char** argv) {
  if (!Problems().empty()) Options().problem = Problems().front().name;
  Options().AddFlags();
  return RunProgramOnRanks(
      argc,
      argv,
      "trains by every rule at every point of a grid of settings\n\n"
      "  sweep --problem=" +
          Options().problem +
          " --steps=200 \\\n"
          "    --grid=\"seed=1..3; "
          "rule=half_inverse,adam:step_size=1e-2|1e-3\"",
      Run);
}

}  // namespace invgrad
