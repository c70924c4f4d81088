#include "bin/support/sweep_results.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <utility>

#include "bin/support/csv_field.h"
#include "invgrad/io/format.h"

namespace invgrad {

namespace {

// By which runs are ordered; infinite for those that failed or are missing.
double Rank(const SweepRun& run, const SweepValue& value) {
  constexpr double kWorst = std::numeric_limits<double>::infinity();
  if (!run.result.has_value() || run.result->has_failed()) return kWorst;
  const double mean = TailMean(run.result->history, value.field, value.tail);
  return std::isfinite(mean) ? mean : kWorst;
}

SweepCell MakeCell(const SweepPlan& plan,
                   const std::vector<SweepRun>& runs,
                   const SweepValue& value,
                   const std::vector<int>& points) {
  std::vector<std::pair<double, int>> ranked;
  ranked.reserve(points.size());
  for (const int point : points) {
    ranked.emplace_back(Rank(runs[plan.points[point].job], value), point);
  }
  std::sort(ranked.begin(), ranked.end());
  SweepCell cell;
  cell.points = points;
  const auto& [median, median_point] = ranked[(ranked.size() - 1) / 2];
  cell.median_point = median_point;
  if (std::isfinite(median)) cell.median = median;
  for (const auto& [rank, point] : ranked) {
    if (std::isfinite(rank)) {
      cell.low = std::fmin(cell.low, rank);
      cell.high = std::fmax(cell.high, rank);
    } else {
      ++cell.num_failed;
    }
  }
  return cell;
}

bool IsBetter(const SweepCell& a, const SweepCell& b) {
  return !std::isnan(a.median) && (std::isnan(b.median) || a.median < b.median);
}

// Reads back as the same number.
std::string NumberField(double value) {
  if (std::isnan(value)) return "";
  std::ostringstream text;
  text.precision(std::numeric_limits<double>::max_digits10);
  text << value;
  return text.str();
}

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words)
    text += (text.empty() ? "" : " ") + word;
  return text;
}

double MillisecondsPerStep(const LearningRunResult& run) {
  return run.summary.num_steps > 0
             ? 1e3 * run.summary.train_time_in_seconds /
                   static_cast<double>(run.summary.num_steps)
             : HistoryRow::kNone;
}

std::string NumberOrDash(double value) {
  return std::isnan(value) ? "-" : FormatNumber(value);
}

std::string SpreadText(const SweepCell& cell) {
  std::string text = NumberOrDash(cell.low);
  if (cell.low < cell.high) text += " - " + FormatNumber(cell.high);
  if (cell.num_failed > 0) {
    text += ", " + std::to_string(cell.num_failed) + " of " +
            std::to_string(cell.points.size()) + " failed or not run";
  }
  return text;
}

}  // namespace

bool FindSweepValue(const SweepPlan& plan,
                    const std::string& name,
                    double tail,
                    SweepValue* value,
                    std::string* error) {
  const auto all_have = [&plan](auto has) {
    return std::all_of(
        plan.jobs.begin(), plan.jobs.end(), [&has](const SweepJob& job) {
          return has(*job.problem);
        });
  };
  const bool have_metric = all_have([](const LearningProblem& problem) {
    return problem.metric.has_value();
  });
  const bool have_test = all_have([](const LearningProblem& problem) {
    return problem.test.num_samples() > 0;
  });
  value->tail = tail;
  if (have_metric && (name == "metric" || name == "auto")) {
    value->name = plan.jobs[0].problem->metric->name;
    value->field = &HistoryRow::metric;
    return true;
  }
  if (have_test && (name == "test_loss" || name == "auto")) {
    value->name = "test loss";
    value->field = &HistoryRow::test_loss;
    return true;
  }
  if (name == "train_loss" || name == "auto") {
    value->name = "train loss";
    value->field = &HistoryRow::train_loss;
    return true;
  }
  *error = "--value=" + name + " is not to be had; allowed: auto, train_loss" +
           (have_test ? ", test_loss" : "") + (have_metric ? ", metric" : "");
  return false;
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

std::vector<SweepBest> FindBest(const SweepPlan& plan,
                                const std::vector<SweepRun>& runs,
                                const SweepValue& value) {
  // The points that differ in the seed alone.
  std::map<std::pair<std::vector<int>, int>, std::vector<int>> seeds;
  for (size_t i = 0; i < plan.points.size(); ++i) {
    std::vector<int> at = plan.points[i].at;
    at[plan.seed_axis] = 0;
    seeds[{at, plan.points[i].alternative}].push_back(static_cast<int>(i));
  }
  std::vector<SweepBest> all;
  for (const auto& [key, points] : seeds) {
    const auto& [at, alternative] = key;
    SweepBest candidate;
    candidate.at = at;
    candidate.alternative = &plan.alternatives[at[plan.rule_axis]][alternative];
    candidate.cell = MakeCell(plan, runs, value, points);
    if (alternative == 0) {
      all.push_back(candidate);
    } else if (IsBetter(candidate.cell, all.back().cell)) {
      all.back() = candidate;
    }
  }
  return all;
}

std::string SweepCsv(const SweepPlan& plan,
                     const std::vector<SweepRun>& runs,
                     const SweepValue& value,
                     const std::vector<SweepBest>& best) {
  std::vector<const SweepBest*> best_of(plan.points.size(), nullptr);
  for (const SweepBest& one : best) {
    for (const int point : one.cell.points) best_of[point] = &one;
  }
  std::ostringstream csv;
  for (const GridAxis& axis : plan.grid.axes) csv << axis.name << ',';
  csv << "alternative,train_loss,test_loss,metric,best_train_loss,steps,"
         "seconds,ms_per_step,best,at_edge,status\n";
  for (size_t i = 0; i < plan.points.size(); ++i) {
    const SweepPoint& point = plan.points[i];
    for (size_t k = 0; k < point.at.size(); ++k) {
      csv << CsvField(plan.grid.axes[k].values[point.at[k]].text) << ',';
    }
    const int rule = point.at[plan.rule_axis];
    csv << CsvField(plan.alternatives[rule][point.alternative].chosen) << ',';
    const SweepRun& run = runs[point.job];
    if (run.result.has_value()) {
      const LearningRunResult& result = *run.result;
      for (const auto field : {&HistoryRow::train_loss,
                               &HistoryRow::test_loss,
                               &HistoryRow::metric}) {
        csv << NumberField(TailMean(result.history, field, value.tail)) << ',';
      }
      csv << NumberField(result.BestTrainLoss()) << ','
          << result.summary.num_steps << ','
          << NumberField(result.summary.train_time_in_seconds) << ','
          << NumberField(MillisecondsPerStep(result)) << ',';
    } else {
      csv << ",,,,,,,";
    }
    const SweepBest* const chosen = best_of[i];
    csv << (chosen != nullptr ? "1," : "0,")
        << (chosen != nullptr ? Joined(chosen->alternative->at_edge) : "")
        << ',' << CsvField(run.status) << '\n';
  }
  return csv.str();
}

Table SweepTable(const SweepPlan& plan,
                 const std::vector<SweepRun>& runs,
                 const SweepValue& value,
                 const std::vector<SweepBest>& best) {
  const std::vector<GridAxis>& axes = plan.grid.axes;
  const bool has_alternatives = std::any_of(
      plan.alternatives.begin(), plan.alternatives.end(), [](const auto& rule) {
        return rule.size() > 1;
      });
  const bool has_seeds = axes[plan.seed_axis].values.size() > 1;
  std::vector<Table::Column> header;
  for (int k = 0; k < static_cast<int>(axes.size()); ++k) {
    if (k == plan.seed_axis) continue;
    const bool is_rule = k == plan.rule_axis;
    header.push_back(
        {axes[k].name, is_rule ? Table::Align::kLeft : Table::Align::kRight});
  }
  if (has_alternatives) {
    header.push_back({"best of"});
    header.push_back({"at the edge of", Table::Align::kLeft});
  }
  header.push_back({value.name});
  if (has_seeds) header.push_back({"all seeds"});
  header.insert(header.end(), {{"steps"}, {"s"}, {"ms/step"}});
  header.push_back({"status", Table::Align::kLeft});
  Table table(header);
  for (const SweepBest& one : best) {
    std::vector<std::string> row;
    for (int k = 0; k < static_cast<int>(axes.size()); ++k) {
      if (k == plan.rule_axis) {
        row.push_back(one.alternative->specification);
      } else if (k != plan.seed_axis) {
        row.push_back(axes[k].values[one.at[k]].text);
      }
    }
    if (has_alternatives) {
      const size_t num_alternatives =
          plan.alternatives[one.at[plan.rule_axis]].size();
      row.push_back(num_alternatives > 1 ? std::to_string(num_alternatives)
                                         : "-");
      row.push_back(one.alternative->at_edge.empty()
                        ? "-"
                        : Joined(one.alternative->at_edge));
    }
    row.push_back(NumberOrDash(one.cell.median));
    if (has_seeds) row.push_back(SpreadText(one.cell));
    const SweepRun& run = runs[plan.points[one.cell.median_point].job];
    if (run.result.has_value()) {
      row.push_back(std::to_string(run.result->summary.num_steps));
      row.push_back(FormatNumber(run.result->summary.train_time_in_seconds));
      row.push_back(NumberOrDash(MillisecondsPerStep(*run.result)));
    } else {
      row.insert(row.end(), {"-", "-", "-"});
    }
    row.push_back(run.status);
    table.AddRow(row);
  }
  return table;
}

}  // namespace invgrad
