#include "bin/compare/learning_comparison.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <set>
#include <utility>

#include "bin/compare/learning_plots.h"
#include "bin/support/learning_run.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/finite.h"
#include "invgrad/io/digest.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"
#include "report/interrupt.h"
#include "report/table.h"

DEFINE_string(seeds,
              "1",
              "seeds of the initial weights and of the shuffling: 1,2,5 or "
              "1..20");
DEFINE_double(target_loss, 0.0, "stop at this train loss; 0: off");
DEFINE_int32(patience,
             0,
             "stop after so many evaluations without a new minimum of the test "
             "loss; 0: off");
DEFINE_string(levels,
              "1e-3,1e-4,1e-5",
              "train losses; the table has the seconds to each");
DEFINE_int32(track_sample,
             0,
             "training sample whose path in y space is kept; -1: none");
DEFINE_bool(resume, false, "go on with the run in the directory");
DEFINE_string(init_weights, "", "initial weights (.npy) for every seed");

namespace invgrad {
namespace {

// A method from all seeds.
struct MethodResults {
  std::string label;
  std::string refusal;  // why there are no runs
  std::vector<LearningRunResult> runs;

  SeedSpread Spread(double HistoryRow::*loss) const {
    std::vector<double> values;
    for (const LearningRunResult& run : runs) {
      values.push_back(run.has_failed() ? HistoryRow::kNone : run.last().*loss);
    }
    return SeedSpread(values);
  }
  // The run with the median of this final loss; null if there are no runs.
  const LearningRunResult* MedianRun(double HistoryRow::*loss) const {
    return runs.empty() ? nullptr : &runs[Spread(loss).median_run];
  }
};

Table LearningTable(const LearningProblem& problem,
                    const std::vector<double>& levels,
                    bool has_many_seeds,
                    const std::vector<MethodResults>& all) {
  Table table;
  for (const MethodResults& method : all) {
    const LearningRunResult none;
    const LearningRunResult* median = method.MedianRun(&HistoryRow::train_loss);
    const LearningRunResult& run = median != nullptr ? *median : none;
    const auto add = [&](const std::string& title, const std::string& cell) {
      table.Add(title, median != nullptr ? cell : "-");
    };
    const auto add_last = [&](const std::string& title,
                              double HistoryRow::*loss) {
      const LearningRunResult* its_run = method.MedianRun(loss);
      add(title, NumberOrDash(its_run ? its_run->last().*loss : 0.0));
    };
    table.BeginRow();
    table.Add("method", method.label, Table::Align::kLeft);
    add_last("train loss", &HistoryRow::train_loss);
    add_last("test loss", &HistoryRow::test_loss);
    add("best train", FormatNumber(run.BestTrainLoss()));
    if (problem.metric.has_value()) {
      add_last(problem.metric->name, &HistoryRow::metric);
    }
    if (has_many_seeds) {
      add("train loss, all seeds",
          method.Spread(&HistoryRow::train_loss).Text());
    }
    AddTimes(median, &table);
    for (const double level : levels) {
      add("s to " + FormatNumber(level),
          NumberOrDash(run.SecondsToLevel(level)));
    }
    const int num_neurons = NumHiddenNeurons(problem.model->network());
    add("saturated",
        num_neurons == 0
            ? "-"
            : fmt::format("{}/{}", run.num_saturated, num_neurons));
    table.Add("status",
              median != nullptr ? run.summary.message : method.refusal,
              Table::Align::kLeft);
  }
  return table;
}

std::string SummaryCsv(const std::vector<MethodResults>& all) {
  Table table;
  for (const MethodResults& method : all) {
    for (const LearningRunResult& run : method.runs) {
      table.BeginRow();
      table.Add("method", run.label);
      table.Add("seed", std::to_string(run.seed));
      table.Add("train_loss", ExactNumber(run.last().train_loss));
      table.Add("test_loss", ExactNumber(run.last().test_loss));
      table.Add("best_train_loss", ExactNumber(run.BestTrainLoss()));
      table.Add("metric", ExactNumber(run.last().metric));
      table.Add("steps", std::to_string(run.summary.num_steps));
      table.Add("seconds", ExactNumber(run.summary.train_time_in_seconds));
      table.Add("saturated", std::to_string(run.num_saturated));
      table.Add("status", run.summary.message);
    }
  }
  return table.ToCsv();
}

// Runs one method from one seed, resumes this run, or reads its results if it
// is complete.
bool RunOrLoad(const LearningProblem& problem,
               const Method& method,
               int batch_size,
               const Eigen::VectorXd& weights,
               int seed,
               LearningRunResult* result,
               std::string* error) {
  LearningRunOptions run;
  run.train = TrainOptionsOfFlags(batch_size, seed);
  run.train.initial_weights = weights;
  run.train.target_loss = FLAGS_target_loss;
  run.train.patience = FLAGS_patience;
  run.tracked_sample = FLAGS_track_sample;
  run.directory =
      fmt::format("{}/{}-seed{}", FLAGS_output, FileName(method.label), seed);
  run.train.communicator = ProgramRanks();
  if (FLAGS_resume) {
    const bool is_complete =
        LoadCompleteRun(problem, method, run, result, error);
    if (!AgreeOnRanks(error->empty(), error)) return false;
    if (!IsTrueOnAnyRank(!is_complete)) return true;
  }
  Progress progress;
  ProgressState state;
  state.label = fmt::format("{} seed {}", method.label, seed);
  run.on_step = [&](const TrainingRun& training) {
    state.step = training.step();
    state.loss = training.history().back().train_loss;
    state.epoch = training.epoch();
    state.fraction = training.progress();
    return ShowProgress(state, &progress);
  };
  return RunLearning(problem, method, run, result, error);
}

}  // namespace

bool CompareLearning(LearningProblem problem,
                     const std::vector<Method>& methods,
                     RunCounts* counts,
                     std::string* error) {
  const int num_samples = problem.train.num_samples();
  std::vector<int> seeds;
  std::vector<double> levels;
  if (FLAGS_overwrite && FLAGS_resume) {
    *error = "--resume=true is not allowed with --overwrite";
    return false;
  }
  if (!CheckFlags({{"target_loss", {0.0}},
                   {"patience", {0.0}},
                   {"track_sample", {-1.0, num_samples - 1.0}}},
                  error) ||
      !ParseFlag("seeds", ParseSeeds, &seeds, error) ||
      !ParseFlag("levels", ParseNumbers, &levels, error)) {
    return false;
  }
  if (!SetNetwork(NetworkOfFlags(), &problem, error)) {
    *error = "--" + *error;
    return false;
  }
  Eigen::VectorXd given_weights;
  if ((!FLAGS_init_weights.empty() &&
       !NameFlag(
           "init_weights",
           ReadNpy(FLAGS_init_weights,
                   problem.model->num_weights(),
                   &given_weights,
                   error) &&
               CheckFinite("file " + FLAGS_init_weights, given_weights, error),
           error)) ||
      !CheckBatches(problem, methods, FLAGS_batch_size, error)) {
    return false;
  }
  const auto initial_weights = [&](int seed) {
    return given_weights.size() > 0 ? given_weights
                                    : InitialWeights(problem, seed);
  };
  const int batch_size = BatchSize(problem, FLAGS_batch_size);
  SetDefaultBudget(problem);
  RunIdentity identity;
  identity.AddData(problem.train, problem.test, problem.source.get());
  if (given_weights.size() > 0) {
    identity.Add("initial weights", Digest().Add(given_weights).Hex());
  }
  if (std::any_of(methods.begin(), methods.end(), [](const Method& method) {
        return method.ReadsProgress();
      })) {
    identity.AddBudget(TrainOptionsOfFlags(batch_size, seeds[0]));
  }
  if (!PrepareRunDirectoryOnRanks(FLAGS_resume ? ExistingDirectory::kResume
                                               : ExistingDirectory::kRefuse,
                                  identity,
                                  error)) {
    return false;
  }
  if (NumRanks() > 1) {
    std::cout << fmt::format(
        "{} ranks. If one of them is lost, the same command with --resume goes "
        "on from the checkpoints in {}\n",
        NumRanks(),
        FLAGS_output);
  }
  const Interrupt interrupt(!IsFirstRank());
  const auto write = [error](const std::string& name, const auto& numbers) {
    const std::string path = FLAGS_output + '/' + name;
    return AgreeOnRanks(!IsFirstRank() || (ListRunFile(path, error) &&
                                           WriteNpy(path, numbers, error)),
                        error);
  };
  if (!write("data.npy", problem.data)) return false;
  std::set<std::string> warned;
  std::vector<MethodResults> all;
  for (const Method& method : methods) {
    all.push_back({method.label, "not run: interrupted", {}});
    WarnOfLeftOutSamples(method, batch_size, num_samples, &warned);
  }
  for (const int seed : seeds) {
    const Eigen::VectorXd weights = initial_weights(seed);
    if (!write(fmt::format("initial_weights-seed{}.npy", seed), weights)) {
      return false;
    }
    for (size_t i = 0; i < methods.size(); ++i) {
      if (IsTrueOnAnyRank(Interrupt::IsRequested())) break;
      LearningRunResult result;
      std::string why;
      if (RunOrLoad(
              problem, methods[i], batch_size, weights, seed, &result, &why)) {
        counts->Add(!result.has_failed());
        all[i].runs.push_back(std::move(result));
      } else {
        counts->Add(false);
        all[i].refusal = "not run: " + why;
        Warn(methods[i].label + ": " + why);
      }
    }
  }
  bool is_written = true;
  if (IsFirstRank()) {
    const Table table = LearningTable(problem, levels, seeds.size() > 1, all);
    std::cout << table.ToText();
    is_written =
        WriteTable(FLAGS_output + "/table", table, error) &&
        WriteRunFile(FLAGS_output + "/summary.csv", SummaryCsv(all), error);
  }
  if (!AgreeOnRanks(is_written, error)) return false;
  if (!IsFirstRank()) return true;
  std::vector<const LearningRunResult*> medians;
  for (const MethodResults& method : all) {
    const LearningRunResult* run = method.MedianRun(&HistoryRow::train_loss);
    if (run != nullptr) medians.push_back(run);
  }
  std::cout << "results in " << FLAGS_output << "\n";
  DrawPictures(LearningPictures(problem,
                                FLAGS_output,
                                FLAGS_track_sample,
                                initial_weights(seeds[0]),
                                medians));
  return true;
}

}  // namespace invgrad
