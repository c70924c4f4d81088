#include "bin/support/learning_comparison.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <sstream>
#include <utility>

#include "bin/support/csv_field.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "invgrad/io/numpy_random.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/progress.h"
#include "report/table.h"

namespace invgrad {

namespace {

std::string RunDirectory(const LearningComparisonOptions& options,
                         const std::string& label,
                         int seed) {
  return options.output + "/" + FileName(label) + "-seed" +
         std::to_string(seed);
}

// The final loss of a run, by which seeds are ordered: failed ones last.
double RankedLoss(const LearningRunResult& run, double HistoryRow::*loss) {
  const double value = run.last().*loss;
  return run.has_failed() || !std::isfinite(value)
             ? std::numeric_limits<double>::infinity()
             : value;
}

// The run with the median of that final loss over the seeds; of an even number
// the lower one.
const LearningRunResult& MedianRun(
    const std::vector<LearningRunResult>& results,
    double HistoryRow::*loss = &HistoryRow::train_loss) {
  std::vector<const LearningRunResult*> sorted;
  sorted.reserve(results.size());
  for (const LearningRunResult& result : results) sorted.push_back(&result);
  std::stable_sort(
      sorted.begin(), sorted.end(), [loss](const auto* a, const auto* b) {
        return RankedLoss(*a, loss) < RankedLoss(*b, loss);
      });
  return *sorted[(sorted.size() - 1) / 2];
}

// "-" for what was not computed or never happened.
std::string NumberOrDash(double value) {
  return std::isnan(value) ? "-" : FormatNumber(value);
}

std::string Spread(const std::vector<LearningRunResult>& results) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  int num_failed = 0;
  for (const LearningRunResult& result : results) {
    if (result.has_failed()) {
      ++num_failed;
      continue;
    }
    low = std::min(low, result.last().train_loss);
    high = std::max(high, result.last().train_loss);
  }
  std::string text =
      high > 0.0 ? FormatNumber(low) + " - " + FormatNumber(high) : "-";
  if (num_failed > 0) {
    text += ", " + std::to_string(num_failed) + " of " +
            std::to_string(results.size()) + " failed";
  }
  return text;
}

// Of one method, all seeds.
struct MethodResults {
  std::string label;
  std::string refusal;  // why the method could not run at all
  std::vector<LearningRunResult> runs;
};

Table MakeTable(const LearningProblem& problem,
                const LearningComparisonOptions& options,
                const std::vector<MethodResults>& all) {
  const bool has_seeds = options.seeds.size() > 1;
  std::vector<Table::Column> header = {{"method", Table::Align::kLeft},
                                       {"train loss"},
                                       {"test loss"},
                                       {"best train"}};
  if (problem.metric.has_value()) header.push_back({problem.metric->name});
  if (has_seeds) header.push_back({"train loss, all seeds"});
  header.insert(header.end(), {{"steps"}, {"s"}, {"ms/step"}});
  for (const double level : options.levels) {
    header.push_back({"s to " + FormatNumber(level)});
  }
  header.push_back({"saturated"});
  header.push_back({"status", Table::Align::kLeft});
  Table table(header);
  for (const MethodResults& method : all) {
    std::vector<std::string> row = {method.label};
    if (method.runs.empty()) {
      row.resize(header.size() - 1, "-");
      row.push_back(method.refusal);
      table.AddRow(row);
      continue;
    }
    const LearningRunResult& run = MedianRun(method.runs);
    const double seconds = run.summary.train_time_in_seconds;
    row.push_back(FormatNumber(run.last().train_loss));
    row.push_back(NumberOrDash(
        MedianRun(method.runs, &HistoryRow::test_loss).last().test_loss));
    row.push_back(FormatNumber(run.BestTrainLoss()));
    if (problem.metric.has_value()) {
      row.push_back(NumberOrDash(
          MedianRun(method.runs, &HistoryRow::metric).last().metric));
    }
    if (has_seeds) row.push_back(Spread(method.runs));
    row.push_back(std::to_string(run.summary.num_steps));
    row.push_back(FormatNumber(seconds));
    row.push_back(run.summary.num_steps > 0
                      ? FormatNumber(1e3 * seconds /
                                     static_cast<double>(run.summary.num_steps))
                      : "-");
    for (const double level : options.levels) {
      const double seconds_to_level = run.SecondsToLevel(level);
      row.push_back(
          std::isnan(seconds_to_level) ? "-" : FormatNumber(seconds_to_level));
    }
    row.push_back(std::to_string(run.num_saturated) + "/" +
                  std::to_string(run.num_hidden_neurons));
    row.push_back(run.summary.message);
    table.AddRow(row);
  }
  return table;
}

std::string SummaryCsv(const std::vector<MethodResults>& all) {
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  csv << "method,seed,train_loss,test_loss,best_train_loss,metric,steps,"
         "seconds,saturated,status\n";
  for (const MethodResults& method : all) {
    for (const LearningRunResult& run : method.runs) {
      csv << CsvField(run.label) << ',' << run.seed << ','
          << run.last().train_loss << ',' << run.last().test_loss << ','
          << run.BestTrainLoss() << ',' << run.last().metric << ','
          << run.summary.num_steps << ',' << run.summary.train_time_in_seconds
          << ',' << run.num_saturated << ',' << CsvField(run.summary.message)
          << '\n';
    }
  }
  return csv.str();
}

Series LossCurve(const LearningRunResult& run,
                 double HistoryRow::*loss,
                 bool against_seconds) {
  Series series;
  series.title = run.label;
  for (const HistoryRow& row : run.history) {
    // The start has no place on a logarithmic axis.
    if (row.step == 0) continue;
    series.x.push_back(against_seconds ? row.seconds
                                       : static_cast<double>(row.step));
    series.y.push_back(row.*loss);
  }
  return series;
}

Plot CurvePlot(const std::vector<MethodResults>& all,
               const std::string& title,
               double HistoryRow::*column,
               bool against_seconds) {
  Plot plot;
  plot.title = title;
  plot.x_label = against_seconds ? "seconds of training" : "step";
  plot.y_label = title;
  plot.log_x = true;
  plot.log_y = true;
  plot.legend = Plot::Legend::kNone;
  for (const MethodResults& method : all) {
    if (method.runs.empty()) continue;
    plot.series.push_back(
        LossCurve(MedianRun(method.runs), column, against_seconds));
  }
  return plot;
}

std::vector<Plot> LossPlots(const LearningProblem& problem,
                            const std::vector<MethodResults>& all) {
  // Test loss where there is one: it is what counts.
  const bool has_test_data = problem.test.num_samples() > 0;
  const std::string title = has_test_data ? "test loss" : "train loss";
  const auto loss =
      has_test_data ? &HistoryRow::test_loss : &HistoryRow::train_loss;
  std::vector<Plot> plots = {CurvePlot(all, title, loss, false),
                             CurvePlot(all, title, loss, true)};
  if (problem.metric.has_value()) {
    plots.push_back(
        CurvePlot(all, problem.metric->name, &HistoryRow::metric, true));
  }
  // One legend is enough: it stands beside the last panel.
  plots.back().legend = Plot::Legend::kOutside;
  return plots;
}

// One panel a method: the mean activation of every hidden neuron.
std::vector<Plot> NeuronPlots(const std::vector<MethodResults>& all) {
  std::vector<Plot> plots;
  for (const MethodResults& method : all) {
    if (method.runs.empty()) continue;
    const LearningRunResult& run = MedianRun(method.runs);
    if (run.neurons.empty()) continue;
    Plot plot;
    plot.title = method.label;
    plot.x_label = "step";
    plot.y_label = "mean activation";
    plot.log_x = true;
    // One legend is enough, and dozens of neurons have no place in it.
    constexpr int kMaxInLegend = 20;
    plot.legend = plots.empty() && run.num_hidden_neurons <= kMaxInLegend
                      ? Plot::Legend::kOutside
                      : Plot::Legend::kNone;
    for (size_t j = 0; j < run.neurons.front().size(); ++j) {
      const NeuronStatistics& neuron = run.neurons.front()[j];
      Series series;
      series.title =
          std::to_string(neuron.layer) + "." + std::to_string(neuron.neuron);
      for (size_t i = 0; i < run.neurons.size(); ++i) {
        if (run.history[i].step == 0) continue;
        series.x.push_back(static_cast<double>(run.history[i].step));
        series.y.push_back(run.neurons[i][j].mean);
      }
      plot.series.push_back(series);
    }
    plots.push_back(plot);
  }
  return plots;
}

Plot SamplePathPlot(const LearningProblem& problem,
                    const LearningComparisonOptions& options,
                    const std::vector<MethodResults>& all) {
  Plot plot;
  plot.title = "training sample " + std::to_string(options.tracked_sample) +
               " in y space";
  plot.x_label = "y_0";
  plot.y_label = "y_1";
  for (const MethodResults& method : all) {
    if (method.runs.empty()) continue;
    const LearningRunResult& run = MedianRun(method.runs);
    if (run.sample_path.empty()) continue;
    Series series;
    series.title = method.label;
    for (const Eigen::VectorXd& y : run.sample_path) {
      series.x.push_back(y[0]);
      series.y.push_back(y[1]);
    }
    plot.series.push_back(series);
  }
  Series target;
  target.title = "target";
  target.style = Series::Style::kPoints;
  target.x = {problem.train.targets(0, options.tracked_sample)};
  target.y = {problem.train.targets(1, options.tracked_sample)};
  plot.series.push_back(target);
  return plot;
}

// What a network of one number learned: x over its input, and the solutions
// that the data were made from.
Plot MapPlot(const LearningProblem& problem,
             const std::vector<MethodResults>& all) {
  const DataSet& data = problem.train;
  std::vector<int> order(data.num_samples());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int i, int j) {
    return data.inputs(0, i) < data.inputs(0, j);
  });
  const DataSet sorted = data.Select(order);
  const auto curve = [&](const std::string& title, const auto& x) {
    Series series;
    series.title = title;
    series.x.assign(sorted.inputs.data(),
                    sorted.inputs.data() + sorted.num_samples());
    series.y.assign(x.data(), x.data() + sorted.num_samples());
    return series;
  };
  Plot plot;
  plot.title = "learned map";
  plot.x_label = "network input";
  plot.y_label = "x";
  if (sorted.solutions.rows() == 1) {
    // First, so that they hide no map; some are enough.
    constexpr int kNumPoints = 200;
    Series solutions;
    solutions.title = "solutions";
    solutions.style = Series::Style::kPoints;
    const int spacing = 1 + sorted.num_samples() / kNumPoints;
    for (int s = 0; s < sorted.num_samples(); s += spacing) {
      solutions.x.push_back(sorted.inputs(0, s));
      solutions.y.push_back(sorted.solutions(0, s));
    }
    plot.series.push_back(solutions);
  }
  for (const MethodResults& method : all) {
    if (method.runs.empty()) continue;
    DenseNetwork::Activations activations;
    std::string ignored;
    if (problem.model->Forward(MedianRun(method.runs).weights,
                               sorted,
                               false,
                               &activations,
                               &ignored)) {
      plot.series.push_back(curve(method.label, activations.outputs));
    }
  }
  return plot;
}

void DrawPictures(const LearningProblem& problem,
                  const LearningComparisonOptions& options,
                  const std::vector<MethodResults>& all) {
  std::string error;
  if (!WritePlots(
          options.output + "/loss.png", LossPlots(problem, all), &error)) {
    Warn(error);
    return;
  }
  const std::vector<Plot> neurons = NeuronPlots(all);
  if (!neurons.empty() &&
      !WritePlots(options.output + "/neurons.png", neurons, &error)) {
    Warn(error);
  }
  if (problem.train.inputs.rows() == 1 &&
      problem.model->simulator().num_inputs() == 1 &&
      !WritePlot(options.output + "/map.png", MapPlot(problem, all), &error)) {
    Warn(error);
  }
  if (options.tracked_sample >= 0 && problem.train.targets.rows() >= 2 &&
      !WritePlot(options.output + "/sample_path.png",
                 SamplePathPlot(problem, options, all),
                 &error)) {
    Warn(error);
  }
}

bool WriteResults(const LearningProblem& problem,
                  const LearningComparisonOptions& options,
                  const std::vector<MethodResults>& all,
                  std::ostream& out,
                  std::string* error) {
  const Table table = MakeTable(problem, options, all);
  out << table.ToText();
  if (options.plots) DrawPictures(problem, options, all);
  return WriteFile(options.output + "/table.txt", table.ToText(), error) &&
         WriteFile(options.output + "/table.md", table.ToMarkdown(), error) &&
         WriteFile(options.output + "/summary.csv", SummaryCsv(all), error);
}

// Runs one method from one seed, goes on with it, or reads it back if it is
// done.
bool RunOrLoad(const LearningProblem& problem,
               const Method& method,
               const LearningComparisonOptions& options,
               const Eigen::VectorXd& weights,
               int seed,
               LearningRunResult* result,
               std::string* error) {
  LearningRunOptions run;
  run.train = options.train;
  run.train.batch_size = BatchSize(problem, options);
  run.train.seed = static_cast<std::uint32_t>(seed);
  run.tracked_sample = options.tracked_sample;
  run.directory = RunDirectory(options, method.label, seed);
  if (options.resume) {
    if (LoadLearningRun(run.directory, problem, result, error) &&
        !HasBudgetLeft(*result, run.train)) {
      return true;
    }
    if (!error->empty()) return false;
  }
  Progress progress;
  ProgressState state;
  state.label = method.label + " seed " + std::to_string(seed);
  run.on_step = [&](const TrainingRun& training) {
    state.step = training.step();
    state.epoch = training.epoch();
    state.loss = training.history().back().train_loss;
    state.fraction = training.progress();
    if (options.shows_progress) progress.Update(state);
    return !Interrupt::IsRequested();
  };
  return RunLearning(problem, method, seed, weights, run, result, error);
}

// Once for every batch size.
void WarnOfLeftOutSamples(const LearningProblem& problem,
                          const std::vector<Method>& methods,
                          const LearningComparisonOptions& options) {
  std::set<std::string> warnings;
  for (const Method& method : methods) {
    AddLeftOutSamples(method,
                      BatchSize(problem, options),
                      problem.train.num_samples(),
                      &warnings);
  }
  for (const std::string& warning : warnings) Warn(warning);
}

}  // namespace

Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed) {
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  return problem.model->network().InitialWeights(problem.initialization,
                                                 &random);
}

int BatchSize(const LearningProblem& problem,
              const LearningComparisonOptions& options) {
  return BatchSize(problem, Phase(), options);
}

int BatchSize(const LearningProblem& problem,
              const Phase& phase,
              const LearningComparisonOptions& options) {
  int batch_size = problem.batch_size;
  if (options.batch_size >= 0) batch_size = options.batch_size;
  if (phase.batch_size >= 0) batch_size = phase.batch_size;
  return batch_size == 0 ? problem.train.num_samples() : batch_size;
}

std::string LeftOutSamples(int batch_size, int num_samples) {
  const int num_left_out = num_samples % batch_size;
  if (num_left_out == 0) return "";
  int below = batch_size;
  while (num_samples % below != 0) --below;
  int above = batch_size;
  while (num_samples % above != 0) ++above;
  return "batch_size=" + std::to_string(batch_size) + ": " +
         std::to_string(num_left_out) + " of " + std::to_string(num_samples) +
         " samples are left out of every epoch; divisors near: " +
         std::to_string(below) + ", " + std::to_string(above);
}

void AddLeftOutSamples(const Method& method,
                       int batch_size,
                       int num_samples,
                       std::set<std::string>* warnings) {
  for (const Phase& phase : method.phases) {
    if (phase.ceres != nullptr) continue;
    int own = phase.batch_size >= 0 ? phase.batch_size : batch_size;
    if (own == 0) own = num_samples;
    const std::string warning = LeftOutSamples(own, num_samples);
    if (!warning.empty()) warnings->insert(warning);
  }
}

bool CheckLearningComparison(const LearningProblem& problem,
                             const std::vector<Method>& methods,
                             const LearningComparisonOptions& options,
                             std::string* error) {
  const int num_samples = problem.train.num_samples();
  if (options.batch_size > num_samples) {
    *error = "--batch_size=" + std::to_string(options.batch_size) +
             " is out of range; allowed: 1 to the " +
             std::to_string(num_samples) + " training samples, or 0 for all";
    return false;
  }
  for (const Method& method : methods) {
    for (const Phase& phase : method.phases) {
      if (BatchSize(problem, phase, options) <= num_samples) continue;
      *error = "--rules: " + method.label +
               ": batch_size=" + std::to_string(phase.batch_size) +
               " is out of range; allowed: 1 to the " +
               std::to_string(num_samples) + " training samples, or 0 for all";
      return false;
    }
  }
  if (options.tracked_sample >= num_samples) {
    *error = "--track_sample=" + std::to_string(options.tracked_sample) +
             " is out of range; allowed: -1 (none) to " +
             std::to_string(num_samples - 1);
    return false;
  }
  return problem.train.IsFinite(error) && problem.test.IsFinite(error);
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
  WarnOfLeftOutSamples(problem, methods, options);
  std::vector<MethodResults> all;
  all.reserve(methods.size());
  for (const Method& method : methods) {
    all.push_back({method.label, "not run: interrupted", {}});
  }
  for (const int seed : options.seeds) {
    const Eigen::VectorXd weights = initial_weights.size() > 0
                                        ? initial_weights
                                        : InitialWeights(problem, seed);
    if (!WriteNpy(options.output + "/initial_weights-seed" +
                      std::to_string(seed) + ".npy",
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
  if (!WriteResults(problem, options, all, out, error)) return false;
  out << "results in " << options.output << "\n";
  return true;
}

}  // namespace invgrad
