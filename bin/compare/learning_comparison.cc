#include "bin/compare/learning_comparison.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <set>
#include <utility>

#include "bin/compare/learning_plots.h"
#include "bin/compare/learning_report.h"
#include "bin/support/html_output.h"
#include "bin/support/learning_run.h"
#include "bin/support/live_run.h"
#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/io/digest.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"
#include "report/interrupt.h"
#include "report/table.h"

namespace invgrad {
namespace {

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
  Table table({{"method"},
               {"seed"},
               {"train_loss"},
               {"test_loss"},
               {"best_train_loss"},
               {"metric"},
               {"steps"},
               {"seconds"},
               {"simulator_calls"},
               {"saturated"},
               {"status"}});
  for (const MethodResults& method : all) {
    for (const LearningRunResult& run : method.runs) {
      table.AddRow({run.label,
                    std::to_string(run.seed),
                    ExactNumber(run.last().train_loss),
                    ExactNumber(run.last().test_loss),
                    ExactNumber(run.BestTrainLoss()),
                    ExactNumber(run.last().metric),
                    std::to_string(run.summary.num_steps),
                    ExactNumber(run.summary.train_time_in_seconds),
                    ExactNumber(run.last().simulator_calls),
                    std::to_string(run.num_saturated),
                    run.summary.message});
    }
  }
  return table.ToCsv();
}

// A comparison: what is checked, then what it found.
struct Comparison {
  LearningProblem problem;
  std::vector<Method> methods;
  std::vector<int> seeds;
  std::vector<double> levels;
  int batch_size = 0;
  Eigen::VectorXd given_weights;       // for every seed; empty: the seed's own
  std::vector<MethodResults> results;  // one a method

  Eigen::VectorXd WeightsOf(int seed) const {
    return given_weights.size() > 0 ? given_weights
                                    : InitialWeights(problem, seed);
  }
};

// Sets all but the results. Changes nothing outside.
bool Check(CompareOptions* options, Comparison* of, std::string* error) {
  const double last_sample = of->problem.train.num_samples() - 1.0;
  if (!CheckResume(options->resume, error) ||
      !CheckFlags({{"target_loss", {0.0}},
                   {"patience", {0.0}},
                   {"track_sample", {-1.0, last_sample}}},
                  error) ||
      !NameFlag(
          "seeds", ParseSeeds(options->seeds, &of->seeds, error), error) ||
      !NameFlag(
          "levels", ParseNumbers(options->levels, &of->levels, error), error)) {
    return false;
  }
  if (!SetNetwork(options->training.network, &of->problem, error)) {
    *error = "--" + *error;
    return false;
  }
  const std::string& file = options->init_weights;
  if (!file.empty() &&
      !NameFlag("init_weights",
                ReadNpy(file,
                        of->problem.model->num_weights(),
                        &of->given_weights,
                        error) &&
                    CheckFinite("file " + file, of->given_weights, error),
                error)) {
    return false;
  }
  of->batch_size = BatchSize(of->problem, options->training.batch_size);
  options->training.SetDefaultBudget(of->problem);
  return CheckBatches(
      of->problem, of->methods, options->training.batch_size, error);
}

// On the first rank. `numbers`: a vector or a matrix.
template <typename Numbers>
bool WriteArray(const std::string& name,
                const Numbers& numbers,
                std::string* error) {
  const std::string path = InOutput(name);
  return AgreeOnRanks(!IsFirstRank() || (ListRunFile(path, error) &&
                                         WriteNpy(path, numbers, error)),
                      error);
}

// Prepares the directory, and writes what is the same for all methods.
bool Prepare(const CompareOptions& options,
             const Comparison& of,
             std::string* error) {
  RunIdentity identity;
  identity.AddData(of.problem.train, of.problem.test, of.problem.source.get());
  if (of.given_weights.size() > 0) {
    identity.Add("initial weights", Digest().Add(of.given_weights).Hex());
  }
  if (std::any_of(of.methods.begin(), of.methods.end(), [](const Method& m) {
        return m.ReadsProgress();
      })) {
    identity.AddBudget(options.training.Options(of.batch_size, of.seeds[0]));
  }
  if (!PrepareRunDirectoryOnRanks(options.resume ? ExistingDirectory::kResume
                                                 : ExistingDirectory::kRefuse,
                                  identity,
                                  error) ||
      !WriteArray("data.npy", of.problem.data, error)) {
    return false;
  }
  for (const int seed : of.seeds) {
    if (!WriteArray(fmt::format("initial_weights-seed{}.npy", seed),
                    of.WeightsOf(seed),
                    error)) {
      return false;
    }
  }
  if (NumRanks() > 1) {
    std::cout << fmt::format(
        "{} ranks. If one of them is lost, the same command with --resume goes "
        "on from the checkpoints in {}\n",
        NumRanks(),
        Output().output);
  }
  std::set<std::string> warned;
  for (const Method& method : of.methods) {
    WarnOfLeftOutSamples(
        method, of.batch_size, of.problem.train.num_samples(), &warned);
  }
  return true;
}

// Runs one method from one seed, resumes this run, or reads its results if it
// is complete.
bool RunOrLoad(const CompareOptions& options,
               const Comparison& of,
               const Method& method,
               int seed,
               LearningRunResult* result,
               std::string* error) {
  LearningRunOptions run;
  run.train = options.training.Options(of.batch_size, seed);
  run.train.initial_weights = of.WeightsOf(seed);
  run.train.target_loss = options.target_loss;
  run.train.patience = options.patience;
  run.tracked_sample = options.track_sample;
  run.directory =
      InOutput(fmt::format("{}-seed{}", FileName(method.label), seed));
  run.train.communicator = ProgramRanks();
  if (options.resume) {
    const bool is_complete =
        LoadCompleteRun(of.problem, method, run, result, error);
    if (!AgreeOnRanks(error->empty(), error)) return false;
    if (!IsTrueOnAnyRank(!is_complete)) return true;
  }
  Progress progress;
  ProgressState state;
  state.label = fmt::format("{} seed {}", method.label, seed);
  state.step = ProgressState::kNoStep;
  ShowProgress(state, &progress);  // the first step may take long
  run.on_step = [&](const TrainingRun& training) {
    state.step = training.step();
    state.loss = training.history().back().train_loss;
    state.epoch = training.epoch();
    if (method.last_phase().races_batch_size) {
      state.batch_size = training.history().back().batch_size;
    }
    state.fraction = training.progress();
    return ShowProgress(state, &progress);
  };
  return RunLearning(of.problem, method, run, result, error);
}

Table TableOf(const Comparison& of) {
  return LearningTable(of.problem, of.levels, of.seeds.size() > 1, of.results);
}

HtmlReport ReportOf(const CompareOptions& options,
                    const Comparison& of,
                    bool is_over) {
  return LearningReport(of.problem,
                        of.methods,
                        of.results,
                        TableOf(of),
                        of.seeds,
                        options.training.BudgetText(),
                        is_over);
}

// All methods from one seed after the other.
void Run(const CompareOptions& options, Comparison* of, RunCounts* counts) {
  for (const Method& method : of->methods) {
    of->results.push_back({method.label, "", {}});
  }
  LiveReport live;
  for (const int seed : of->seeds) {
    for (size_t i = 0; i < of->methods.size(); ++i) {
      if (IsTrueOnAnyRank(Interrupt::IsRequested())) break;
      if (IsFirstRank()) {
        live.Update([&] { return ReportOf(options, *of, /*is_over=*/false); });
      }
      LearningRunResult result;
      std::string why;
      const bool has_run =
          RunOrLoad(options, *of, of->methods[i], seed, &result, &why);
      counts->Add(has_run && !result.has_failed());
      if (has_run) {
        of->results[i].runs.push_back(std::move(result));
      } else {
        of->results[i].refusal = "not run: " + why;
        Warn(of->methods[i].label + ": " + why);
      }
    }
  }
  for (MethodResults& method : of->results) {
    if (method.refusal.empty()) method.refusal = "not run: interrupted";
  }
}

// Tables and pictures, on the first rank.
bool Report(const CompareOptions& options,
            const Comparison& of,
            std::string* error) {
  bool is_written = true;
  if (IsFirstRank()) {
    const Table table = TableOf(of);
    std::cout << table.ToText();
    is_written =
        WriteTable(InOutput("table"), table, error) &&
        WriteRunFile(InOutput("summary.csv"), SummaryCsv(of.results), error);
  }
  if (!AgreeOnRanks(is_written, error)) return false;
  if (!IsFirstRank()) return true;
  std::vector<const LearningRunResult*> medians;
  for (const MethodResults& method : of.results) {
    const LearningRunResult* run = method.MedianRun(&HistoryRow::train_loss);
    if (run != nullptr) medians.push_back(run);
  }
  std::cout << "results in " << Output().output << "\n";
  FinishReport(ReportOf(options, of, /*is_over=*/true),
               LearningPictures(of.problem,
                                Output().output,
                                options.track_sample,
                                of.WeightsOf(of.seeds[0]),
                                medians));
  return true;
}

}  // namespace

bool CompareLearning(CompareOptions* options,
                     LearningProblem problem,
                     const std::vector<Method>& methods,
                     RunCounts* counts,
                     std::string* error) {
  Comparison comparison;
  comparison.problem = std::move(problem);
  comparison.methods = methods;
  if (!AgreeOnRanks(Check(options, &comparison, error), error) ||
      !Prepare(*options, comparison, error)) {
    return false;
  }
  const Interrupt interrupt(!IsFirstRank());
  Run(*options, &comparison, counts);
  return Report(*options, comparison, error);
}

}  // namespace invgrad
