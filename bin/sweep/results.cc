#include "bin/sweep/results.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "fmt/ranges.h"

namespace invgrad {
namespace {

std::string AtEdge(const SweepBest& best) {
  return fmt::format("{}", fmt::join(best.alternative->at_edge, " "));
}

}  // namespace

bool FindSweepValue(const SweepPlan& plan,
                    const std::string& name,
                    double tail,
                    SweepValue* value,
                    std::string* error) {
  bool has_metric = true, has_test = true;
  for (const SweepJob& job : plan.jobs) {
    has_metric =
        has_metric && job.is_training() && job.learning().metric.has_value();
    has_test =
        has_test && job.is_training() && job.learning().test.num_samples() > 0;
  }
  const bool is_auto = name == "auto";
  if (has_metric && (name == "metric" || is_auto)) {
    *value = {plan.jobs[0].learning().metric->name, &HistoryRow::metric, tail};
  } else if (has_test && (name == "test_loss" || is_auto)) {
    *value = {"test loss", &HistoryRow::test_loss, tail};
  } else if (name == "train_loss" || is_auto) {
    const bool is_training = plan.jobs[0].is_training();
    *value = {
        is_training ? "train loss" : "cost", &HistoryRow::train_loss, tail};
  } else {
    *error =
        fmt::format("--value={} is not there; allowed: auto, train_loss{}{}",
                    name,
                    has_test ? ", test_loss" : "",
                    has_metric ? ", metric" : "");
    return false;
  }
  return true;
}

double TailMean(const History& history,
                double HistoryRow::*field,
                double tail) {
  const double begin = (1.0 - tail) * history.back().seconds;
  double sum = history.back().*field;
  int count = 1;
  for (size_t i = history.size() - 1; i-- > 0 && tail > 0.0;) {
    if (history[i].seconds < begin) break;
    sum += history[i].*field;
    ++count;
  }
  return sum / count;
}

SweepResults FindBest(const SweepPlan& plan,
                      const std::vector<SweepRun>& runs,
                      const SweepValue& value) {
  // The points that differ in the seed alone.
  std::map<std::pair<std::vector<int>, int>, std::vector<int>> seeds;
  for (size_t i = 0; i < plan.points.size(); ++i) {
    std::vector<int> at = plan.points[i].at;
    at[plan.seed_axis] = 0;
    seeds[{at, plan.points[i].alternative}].push_back(static_cast<int>(i));
  }
  SweepResults results{plan, runs, value, {}};
  std::vector<SweepBest>& all = results.best;
  for (const auto& [key, points] : seeds) {
    const auto& [at, alternative] = key;
    std::vector<double> values;
    for (const int point : points) {
      const auto& run = runs[plan.points[point].job].result;
      values.push_back(run.has_value() && !run->has_failed()
                           ? TailMean(run->history, value.field, value.tail)
                           : HistoryRow::kNone);
    }
    const SweepBest candidate{
        at,
        &plan.alternatives[at[plan.rule_axis]][alternative],
        points,
        SeedSpread(values)};
    const double median = candidate.spread.median;
    if (alternative == 0) {
      all.push_back(candidate);
    } else if (!std::isnan(median) && !(median >= all.back().spread.median)) {
      all.back() = candidate;
    }
  }
  return results;
}

std::string SweepCsv(const SweepResults& results) {
  const SweepPlan& plan = results.plan;
  // One per point; null if another alternative is best there.
  std::vector<const SweepBest*> best_of(plan.points.size(), nullptr);
  for (const SweepBest& one : results.best) {
    for (const int point : one.points) best_of[point] = &one;
  }
  LearningRunResult none;
  none.history.emplace_back();
  Table table;
  for (size_t i = 0; i < plan.points.size(); ++i) {
    const SweepPoint& point = plan.points[i];
    const SweepRun& run = results.runs[point.job];
    const bool is_there = run.result.has_value();
    const LearningRunResult& result = is_there ? *run.result : none;
    const auto add = [&](const std::string& title, double number) {
      table.Add(title,
                is_there && !std::isnan(number) ? ExactNumber(number) : "");
    };
    const auto mean = [&](double HistoryRow::*field) {
      return TailMean(result.history, field, results.value.tail);
    };
    table.BeginRow();
    for (size_t k = 0; k < point.at.size(); ++k) {
      const GridAxis& axis = plan.grid.axes[k];
      table.Add(axis.name, axis.values[point.at[k]]);
    }
    const int rule = point.at[plan.rule_axis];
    table.Add("alternative", plan.alternatives[rule][point.alternative].chosen);
    add("train_loss", mean(&HistoryRow::train_loss));
    add("test_loss", mean(&HistoryRow::test_loss));
    add("metric", mean(&HistoryRow::metric));
    add("best_train_loss", result.BestTrainLoss());
    add("steps", static_cast<double>(result.summary.num_steps));
    add("seconds", result.summary.train_time_in_seconds);
    add("ms_per_step", result.MillisecondsPerStep());
    table.Add("best", best_of[i] != nullptr ? "1" : "0");
    table.Add("at_edge", best_of[i] != nullptr ? AtEdge(*best_of[i]) : "");
    table.Add("status", run.status);
  }
  return table.ToCsv();
}

Table SweepTable(const SweepResults& results) {
  const SweepPlan& plan = results.plan;
  const std::vector<GridAxis>& axes = plan.grid.axes;
  const bool has_alternatives = std::any_of(
      plan.alternatives.begin(), plan.alternatives.end(), [](const auto& rule) {
        return rule.size() > 1;
      });
  Table table;
  for (const SweepBest& one : results.best) {
    table.BeginRow();
    for (int k = 0; k < static_cast<int>(axes.size()); ++k) {
      if (k == plan.rule_axis) {
        table.Add("rule", one.alternative->specification, Table::Align::kLeft);
      } else if (k != plan.seed_axis) {
        table.Add(axes[k].name, axes[k].values[one.at[k]]);
      }
    }
    if (has_alternatives) {
      const size_t size = plan.alternatives[one.at[plan.rule_axis]].size();
      const std::string edge = AtEdge(one);
      table.Add("best of", size > 1 ? std::to_string(size) : "-");
      table.Add(
          "at the edge of", edge.empty() ? "-" : edge, Table::Align::kLeft);
    }
    table.Add(results.value.name, NumberOrDash(one.spread.median));
    if (axes[plan.seed_axis].values.size() > 1) {
      table.Add("all seeds", one.spread.Text());
    }
    const SweepRun& run = results.runs[plan.points[one.median_point()].job];
    AddTimes(run.result.has_value() ? &*run.result : nullptr, &table);
    table.Add("status", run.status, Table::Align::kLeft);
  }
  return table;
}

}  // namespace invgrad
