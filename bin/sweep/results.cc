#include "bin/sweep/results.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>

#include "bin/support/training.h"
#include "fmt/format.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

SeedSpread SpreadOf(const SweepPlan& plan,
                    const std::vector<SweepRun>& runs,
                    const SweepValue& value,
                    const std::vector<int>& points) {
  std::vector<double> values;
  for (const int point : points) {
    const std::optional<LearningRunResult>& run =
        runs[plan.points[point].job].result;
    values.push_back(run.has_value() && !run->has_failed()
                         ? TailMean(run->history, value.field, value.tail)
                         : HistoryRow::kNone);
  }
  return SeedSpread(values);
}

bool IsBetter(const SeedSpread& a, const SeedSpread& b) {
  return !std::isnan(a.median) && !(a.median >= b.median);
}

std::string NumberOrEmpty(double value) {
  return std::isnan(value) ? "" : ExactNumber(value);
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
  *error = fmt::format("--value={} is not there; allowed: auto, train_loss{}{}",
                       name,
                       have_test ? ", test_loss" : "",
                       have_metric ? ", metric" : "");
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
    const SweepBest candidate{
        at,
        &plan.alternatives[at[plan.rule_axis]][alternative],
        points,
        SpreadOf(plan, runs, value, points)};
    if (alternative == 0) {
      all.push_back(candidate);
    } else if (IsBetter(candidate.spread, all.back().spread)) {
      all.back() = candidate;
    }
  }
  return all;
}

Table SweepRuns(const SweepPlan& plan,
                const std::vector<SweepRun>& runs,
                const SweepValue& value,
                const std::vector<SweepBest>& best) {
  struct Row {
    const SweepPoint* point;
    const SweepRun* run;
    const SweepBest* best;  // null: the point is of another alternative
  };
  std::vector<Row> rows;
  for (const SweepPoint& point : plan.points) {
    rows.push_back({&point, &runs[point.job], nullptr});
  }
  for (const SweepBest& one : best) {
    for (const int point : one.points) rows[point].best = &one;
  }
  const auto of_run = [](auto cell) {
    return [cell](const Row& row) {
      return row.run->result.has_value() ? cell(*row.run->result)
                                         : std::string();
    };
  };
  const auto mean = [&](double HistoryRow::*field) {
    return of_run([&value, field](const LearningRunResult& run) {
      return NumberOrEmpty(TailMean(run.history, field, value.tail));
    });
  };
  std::vector<ColumnOf<Row>> columns;
  for (size_t k = 0; k < plan.grid.axes.size(); ++k) {
    columns.push_back({plan.grid.axes[k].name, [&plan, k](const Row& row) {
                         return plan.grid.axes[k].values[row.point->at[k]];
                       }});
  }
  const std::vector<ColumnOf<Row>> results = {
      {"alternative",
       [&plan](const Row& row) {
         return plan
             .alternatives[row.point->at[plan.rule_axis]]
                          [row.point->alternative]
             .chosen;
       }},
      {"train_loss", mean(&HistoryRow::train_loss)},
      {"test_loss", mean(&HistoryRow::test_loss)},
      {"metric", mean(&HistoryRow::metric)},
      {"best_train_loss", of_run([](const LearningRunResult& run) {
         return NumberOrEmpty(run.BestTrainLoss());
       })},
      {"steps", of_run([](const LearningRunResult& run) {
         return std::to_string(run.summary.num_steps);
       })},
      {"seconds", of_run([](const LearningRunResult& run) {
         return NumberOrEmpty(run.summary.train_time_in_seconds);
       })},
      {"ms_per_step", of_run([](const LearningRunResult& run) {
         return NumberOrEmpty(MillisecondsPerStep(run));
       })},
      {"best", [](const Row& row) { return row.best != nullptr ? "1" : "0"; }},
      {"at_edge",
       [](const Row& row) {
         return row.best == nullptr
                    ? ""
                    : fmt::format(
                          "{}", fmt::join(row.best->alternative->at_edge, " "));
       }},
      {"status", [](const Row& row) { return row.run->status; }}};
  columns.insert(columns.end(), results.begin(), results.end());
  return MakeTable(columns, rows);
}

Table SweepTable(const SweepPlan& plan,
                 const std::vector<SweepRun>& runs,
                 const SweepValue& value,
                 const std::vector<SweepBest>& best) {
  const auto run_of = [&](const SweepBest& one) -> const SweepRun& {
    return runs[plan.points[one.median_point()].job];
  };
  const auto of_run = [&](auto cell) {
    return [&run_of, cell](const SweepBest& one) {
      const SweepRun& run = run_of(one);
      return run.result.has_value() ? cell(*run.result) : std::string("-");
    };
  };
  std::vector<ColumnOf<SweepBest>> columns;
  bool has_alternatives = false;
  for (const auto& rule : plan.alternatives) {
    has_alternatives = has_alternatives || rule.size() > 1;
  }
  const std::vector<GridAxis>& axes = plan.grid.axes;
  for (int k = 0; k < static_cast<int>(axes.size()); ++k) {
    if (k == plan.rule_axis) {
      columns.push_back(
          {"rule",
           [](const SweepBest& one) { return one.alternative->specification; },
           Table::Align::kLeft});
    } else if (k != plan.seed_axis) {
      columns.push_back({axes[k].name, [&axes, k](const SweepBest& one) {
                           return axes[k].values[one.at[k]];
                         }});
    }
  }
  if (has_alternatives) {
    columns.push_back({"best of", [&plan](const SweepBest& one) {
                         const size_t size =
                             plan.alternatives[one.at[plan.rule_axis]].size();
                         return size > 1 ? std::to_string(size) : "-";
                       }});
    columns.push_back(
        {"at the edge of",
         [](const SweepBest& one) {
           const auto& at_edge = one.alternative->at_edge;
           return at_edge.empty() ? "-"
                                  : fmt::format("{}", fmt::join(at_edge, " "));
         },
         Table::Align::kLeft});
  }
  columns.push_back({value.name, [](const SweepBest& one) {
                       return NumberOrDash(one.spread.median);
                     }});
  if (axes[plan.seed_axis].values.size() > 1) {
    columns.push_back(
        {"all seeds", [](const SweepBest& one) { return one.spread.Text(); }});
  }
  columns.push_back({"steps", of_run([](const LearningRunResult& run) {
                       return std::to_string(run.summary.num_steps);
                     })});
  columns.push_back({"s", of_run([](const LearningRunResult& run) {
                       return FormatNumber(run.summary.train_time_in_seconds);
                     })});
  columns.push_back({"ms/step", of_run([](const LearningRunResult& run) {
                       return NumberOrDash(MillisecondsPerStep(run));
                     })});
  columns.push_back({"status",
                     [&](const SweepBest& one) { return run_of(one).status; },
                     Table::Align::kLeft});
  return MakeTable(columns, best);
}

}  // namespace invgrad
