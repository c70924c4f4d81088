#include "bin/compare/learning_report.h"

#include <cmath>
#include <map>
#include <utility>

#include "bin/support/html_output.h"
#include "fmt/ranges.h"
#include "invgrad/dense_network.h"
#include "invgrad/io/format.h"
#include "report/answer.h"
#include "report/run_curves.h"

namespace invgrad {
namespace {

using Field = double HistoryRow::*;

std::string Sizes(const LearningProblem& problem) {
  const Network& network = problem.model->network();
  const auto* dense = dynamic_cast<const DenseNetwork*>(&network);
  return fmt::format(
      "network {} with {} weights, simulator {} to {}; {} training samples, {} "
      "test samples",
      dense != nullptr
          ? fmt::format("{}", fmt::join(dense->widths(), "-"))
          : fmt::format(
                "{} to {}", network.num_inputs(), network.num_outputs()),
      problem.model->num_weights(),
      problem.model->simulator().num_inputs(),
      problem.model->simulator().num_outputs(),
      problem.train.num_samples(),
      problem.test.num_samples());
}

std::vector<std::pair<std::string, std::string>> Facts(
    const LearningProblem& problem,
    const std::vector<int>& seeds,
    const std::string& budget) {
  std::vector<std::pair<std::string, std::string>> facts = ProblemFacts();
  facts.emplace_back("sizes", Sizes(problem));
  facts.emplace_back("budget", budget + ", each method and seed");
  facts.emplace_back("seeds", fmt::format("{}", fmt::join(seeds, ", ")));
  return facts;
}

// The curve of a run; a failed one ends in no value.
Series RunCurve(const LearningRunResult& run, Field y, Field x) {
  Series curve;
  for (const HistoryRow& row : run.history) {
    if (row.step == 0) continue;
    curve.x.push_back(x == nullptr ? static_cast<double>(row.step) : row.*x);
    curve.y.push_back(row.*y);
  }
  EndFailedCurve(run.has_failed(), &curve);
  return curve;
}

// Whether all runs have counted them; old ones have not.
bool HasCalls(const std::vector<MethodResults>& all) {
  for (const MethodResults& method : all) {
    for (const LearningRunResult& run : method.runs) {
      if (std::isnan(run.last().simulator_calls)) return false;
    }
  }
  return true;
}

HtmlReport::Chart Curves(const LearningProblem& problem,
                         const std::vector<MethodResults>& all,
                         bool has_many_seeds) {
  std::vector<std::pair<std::string, Field>> ys;
  if (problem.test.num_samples() > 0) {
    ys.emplace_back("test loss", &HistoryRow::test_loss);
  }
  ys.emplace_back("train loss", &HistoryRow::train_loss);
  if (problem.metric.has_value()) {
    ys.emplace_back(problem.metric->name, &HistoryRow::metric);
  }
  HtmlReport::Chart chart;
  chart.title = "Curves";
  chart.caption =
      has_many_seeds
          ? "A line is the median over the seeds, its band reaches from the "
            "lowest to the highest seed."
          : "One seed, evaluated at the points of the history.";
  std::vector<std::pair<std::string, Field>> xs = {
      {"seconds of training", &HistoryRow::seconds},
      {"step", nullptr},
      {"passes over the data (epochs)", &HistoryRow::epoch}};
  if (HasCalls(all)) {
    xs.emplace_back("calls of the simulator", &HistoryRow::simulator_calls);
  }
  for (const auto& [y_name, y] : ys) {
    for (const auto& [x_name, x] : xs) {
      Plot& view = chart.views.emplace_back();
      view.x_label = x_name;
      view.y_label = y_name;
      view.log_x = view.log_y = true;
      for (size_t i = 0; i < all.size(); ++i) {
        std::vector<Series> runs;
        for (const LearningRunResult& run : all[i].runs) {
          runs.push_back(RunCurve(run, y, x));
        }
        if (runs.empty()) continue;
        AddCurve(i, MedianCurve(runs), all[i].runs[0].history[0].*y, &view);
      }
    }
  }
  return chart;
}

std::string Answer(const LearningProblem& problem,
                   const std::vector<Method>& methods,
                   const std::vector<MethodResults>& all,
                   const std::vector<HtmlReport::Method>& names) {
  const bool has_test = problem.test.num_samples() > 0;
  const Field loss =
      has_test ? &HistoryRow::test_loss : &HistoryRow::train_loss;
  std::vector<Score> scores;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].runs.empty() && all[i].refusal.empty()) continue;
    const SeedSpread spread = all[i].Spread(loss);
    scores.push_back({names[i].name,
                      spread.median,
                      spread.low,
                      spread.Highest(),
                      static_cast<int>(spread.num_runs),
                      IsFirstOrder(methods[i])});
  }
  return AnswerByScores(has_test ? "test loss" : "train loss", scores);
}

std::vector<std::string> Warnings(const std::vector<MethodResults>& all,
                                  size_t num_seeds) {
  std::vector<std::string> warnings;
  for (const MethodResults& method : all) {
    std::map<std::string, std::vector<int>> failures;  // seeds by message
    for (const LearningRunResult& run : method.runs) {
      if (run.has_failed()) failures[run.summary.message].push_back(run.seed);
    }
    for (const auto& [message, seeds] : failures) {
      warnings.push_back(fmt::format(
          "{}, seed {}: {}", method.label, fmt::join(seeds, ", "), message));
    }
    if (method.runs.size() < num_seeds && !method.refusal.empty()) {
      warnings.push_back(fmt::format("{}, {} of {} seeds: {}",
                                     method.label,
                                     num_seeds - method.runs.size(),
                                     num_seeds,
                                     method.refusal));
    }
  }
  return warnings;
}

Table RunsTable(const std::vector<MethodResults>& all) {
  Table table;
  for (const MethodResults& method : all) {
    for (const LearningRunResult& run : method.runs) {
      table.BeginRow();
      table.Add("method", run.label, Table::Align::kLeft);
      table.Add("seed", std::to_string(run.seed));
      table.Add("train loss", NumberOrDash(run.last().train_loss));
      table.Add("test loss", NumberOrDash(run.last().test_loss));
      AddTimes(&run, &table);
      table.Add("status", run.summary.message, Table::Align::kLeft);
    }
  }
  return table;
}

}  // namespace

SeedSpread MethodResults::Spread(double HistoryRow::*loss) const {
  std::vector<double> values;
  for (const LearningRunResult& run : runs) {
    values.push_back(run.has_failed() ? HistoryRow::kNone : run.last().*loss);
  }
  return SeedSpread(values);
}

const LearningRunResult* MethodResults::MedianRun(
    double HistoryRow::*loss) const {
  return runs.empty() ? nullptr : &runs[Spread(loss).median_run];
}

HtmlReport LearningReport(const LearningProblem& problem,
                          const std::vector<Method>& methods,
                          const std::vector<MethodResults>& all,
                          const Table& table,
                          const std::vector<int>& seeds,
                          const std::string& budget,
                          bool is_over) {
  std::vector<std::string> labels;
  labels.reserve(all.size());
  for (const MethodResults& method : all) labels.push_back(method.label);
  const auto facts = Facts(problem, seeds, budget);
  HtmlReport report = NewReport(
      facts[0].second,
      fmt::format("Which of {} methods trains the network to the lowest loss, "
                  "from the same weights, with {}?",
                  all.size(),
                  budget),
      labels,
      facts);
  size_t num_done = 0;
  for (const MethodResults& method : all) num_done += method.runs.size();
  if (!is_over) {
    report.progress = ProgressText(num_done, all.size() * seeds.size());
  }
  report.answer =
      num_done == 0 ? "" : Answer(problem, methods, all, report.methods);
  report.warnings = Warnings(all, seeds.size());
  report.charts.push_back(Curves(problem, all, seeds.size() > 1));
  HtmlReport::Sheet sheet{
      "Methods",
      "The best of a column is marked. Times and status are of the run with "
      "the median train loss; \"s to\" is the time to this train loss.",
      table,
      {},
      {}};
  for (const std::string& title : table.rows()[0]) {
    if (title != "steps" && title != "s" && title != "ms/step" &&
        title != "saturated") {
      sheet.least.push_back(title);
    }
  }
  report.sheets.push_back(sheet);
  if (seeds.size() > 1 && num_done > 0) {
    report.sheets.push_back({"All runs", "", RunsTable(all), {}, {}, true});
  }
  return report;
}

}  // namespace invgrad
