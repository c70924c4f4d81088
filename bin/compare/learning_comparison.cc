#include "bin/compare/learning_comparison.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "bin/compare/learning_plots.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/results.h"
#include "bin/support/run_directory.h"
#include "bin/support/training.h"
#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "report/interrupt.h"
#include "report/table.h"

namespace invgrad {
namespace {

SeedSpread SpreadOf(const std::vector<LearningRunResult>& runs,
                    double HistoryRow::*loss) {
  std::vector<double> values;
  values.reserve(runs.size());
  for (const LearningRunResult& run : runs) {
    values.push_back(run.has_failed() ? HistoryRow::kNone : run.last().*loss);
  }
  return SeedSpread(values);
}

Table LearningTable(const LearningProblem& problem,
                    const LearningComparisonOptions& options,
                    const std::vector<MethodResults>& all) {
  Table table;
  for (const MethodResults& method : all) {
    const bool has_runs = !method.runs.empty();
    LearningRunResult none;
    none.history.emplace_back();
    const auto median = [&](double HistoryRow::*loss) -> const auto& {
      return has_runs ? method.MedianRun(loss) : none;
    };
    const auto add = [&](const std::string& title, const std::string& cell) {
      table.Add(title, has_runs ? cell : "-");
    };
    const auto add_last = [&](const std::string& title,
                              double HistoryRow::*loss) {
      add(title, NumberOrDash(median(loss).last().*loss));
    };
    const LearningRunResult& run = median(&HistoryRow::train_loss);
    table.BeginRow();
    table.Add("method", method.label, Table::Align::kLeft);
    add_last("train loss", &HistoryRow::train_loss);
    add_last("test loss", &HistoryRow::test_loss);
    add("best train", FormatNumber(run.BestTrainLoss()));
    if (problem.metric.has_value()) {
      add_last(problem.metric->name, &HistoryRow::metric);
    }
    if (options.seeds.size() > 1) {
      add("train loss, all seeds",
          SpreadOf(method.runs, &HistoryRow::train_loss).Text());
    }
    AddTimes(run, has_runs, &table);
    for (const double level : options.levels) {
      add("s to " + FormatNumber(level),
          NumberOrDash(run.SecondsToLevel(level)));
    }
    add("saturated",
        fmt::format("{}/{}", run.num_saturated, run.num_hidden_neurons));
    table.Add("status",
              has_runs ? run.summary.message : method.refusal,
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
               const LearningComparisonOptions& options,
               const Eigen::VectorXd& weights,
               int seed,
               LearningRunResult* result,
               std::string* error) {
  LearningRunOptions run;
  run.train = options.train;
  run.train.batch_size = BatchSize(problem, options.batch_size);
  run.train.seed = static_cast<std::uint32_t>(seed);
  run.tracked_sample = options.tracked_sample;
  run.directory =
      fmt::format("{}/{}-seed{}", options.output, FileName(method.label), seed);
  if (options.resume) {
    if (LoadCompleteRun(run.directory, problem, run.train, result, error)) {
      return true;
    }
    if (!error->empty()) return false;
  }
  LiveRun live(fmt::format("{} seed {}", method.label, seed));
  run.on_step = [&live](const TrainingRun& training) {
    return live.Update({training.step(),
                        training.history().back().train_loss,
                        training.epoch(),
                        training.progress()});
  };
  return RunLearning(problem, method, seed, weights, run, result, error);
}

}  // namespace

const LearningRunResult& MethodResults::MedianRun(
    double HistoryRow::*loss) const {
  return runs[SpreadOf(runs, loss).median_run];
}

bool CheckLearningComparison(const LearningProblem& problem,
                             const std::vector<Method>& methods,
                             const LearningComparisonOptions& options,
                             std::string* error) {
  const int num_samples = problem.train.num_samples();
  if (options.tracked_sample >= num_samples) {
    *error = fmt::format(
        "--track_sample={} is out of range; allowed: -1 (none) to {}",
        options.tracked_sample,
        num_samples - 1);
    return false;
  }
  return CheckBatches(problem, methods, options.batch_size, error);
}

bool CompareLearning(const LearningProblem& problem,
                     const std::vector<Method>& methods,
                     const LearningComparisonOptions& options,
                     const Eigen::VectorXd& initial_weights,
                     std::ostream& out,
                     std::string* error) {
  const Interrupt interrupt;
  if (!WriteNpy(options.output + "/data.npy", problem.data, error)) {
    return false;
  }
  std::set<std::string> warnings;
  std::vector<MethodResults> all;
  for (const Method& method : methods) {
    all.push_back({method.label, "not run: interrupted", {}});
    AddLeftOutSamples(method,
                      BatchSize(problem, options.batch_size),
                      problem.train.num_samples(),
                      &warnings);
  }
  for (const std::string& warning : warnings) Warn(warning);
  for (const int seed : options.seeds) {
    const Eigen::VectorXd weights = initial_weights.size() > 0
                                        ? initial_weights
                                        : InitialWeights(problem, seed);
    if (!WriteNpy(
            fmt::format("{}/initial_weights-seed{}.npy", options.output, seed),
            weights,
            error)) {
      return false;
    }
    for (size_t i = 0; i < methods.size() && !Interrupt::IsRequested(); ++i) {
      LearningRunResult result;
      std::string why;
      if (RunOrLoad(
              problem, methods[i], options, weights, seed, &result, &why)) {
        all[i].runs.push_back(std::move(result));
      } else {
        all[i].refusal = "not run: " + why;
        Warn(methods[i].label + ": " + why);
      }
    }
  }
  const Table table = LearningTable(problem, options, all);
  out << table.ToText();
  if (!WriteTable(options.output + "/table", table, error) ||
      !WriteFile(options.output + "/summary.csv", SummaryCsv(all), error)) {
    return false;
  }
  DrawLearning(problem, options.output, options.tracked_sample, all);
  out << "results in " << options.output << "\n";
  *error = "no method could run";
  return std::any_of(all.begin(), all.end(), [](const MethodResults& method) {
    return !method.runs.empty();
  });
}

}  // namespace invgrad
