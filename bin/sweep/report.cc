#include "bin/sweep/report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "bin/support/html_output.h"
#include "fmt/ranges.h"
#include "report/answer.h"
#include "report/html_profiles.h"
#include "report/run_curves.h"

namespace invgrad {
namespace {

const std::vector<std::string>& RulesOf(const SweepResults& results) {
  return results.plan.grid.axes[results.plan.rule_axis].values;
}

// "xi=32, phi=45": what tells the point from others, but for rule and seed.
std::string PointName(const SweepPlan& plan, const std::vector<int>& at) {
  std::vector<std::string> parts;
  for (int k = 0; k < static_cast<int>(at.size()); ++k) {
    const GridAxis& axis = plan.grid.axes[k];
    if (k == plan.rule_axis || k == plan.seed_axis || axis.values.size() < 2) {
      continue;
    }
    parts.push_back(axis.name + "=" + axis.values[at[k]]);
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

// The value against seconds or steps; empty if there is no run.
Series RunCurve(const SweepResults& results, int point, bool against_seconds) {
  Series curve;
  const auto& run = results.runs[results.plan.points[point].job].result;
  if (!run.has_value()) return curve;
  for (const HistoryRow& row : run->history) {
    curve.x.push_back(against_seconds ? row.seconds
                                      : static_cast<double>(row.step));
    curve.y.push_back(row.*(results.value.field));
  }
  EndFailedCurve(run->has_failed(), &curve);
  return curve;
}

// Points of the grid in its order, and the best of each rule there.
using Groups =
    std::vector<std::pair<std::string, std::vector<const SweepBest*>>>;

Groups GroupByPoint(const SweepResults& results) {
  Groups groups;
  std::map<std::string, size_t> found;
  for (const SweepBest& best : results.best) {
    const std::string name = PointName(results.plan, best.at);
    const auto [it, is_new] = found.emplace(name, groups.size());
    if (is_new) groups.push_back({name, {}});
    groups[it->second].second.push_back(&best);
  }
  return groups;
}

HtmlReport::Chart CurveChart(const SweepResults& results,
                             const Groups& groups) {
  constexpr size_t kMaxPoints = 40;
  HtmlReport::Chart chart;
  chart.title = "Curves";
  chart.caption =
      "A line is the median over the seeds, its band reaches from "
      "the lowest to the highest seed.";
  if (groups.size() > kMaxPoints) {
    chart.caption += fmt::format(
        " The first {} of {} points of the grid.", kMaxPoints, groups.size());
  }
  const std::string seconds =
      results.plan.jobs[0].is_training() ? "seconds of training" : "seconds";
  for (size_t g = 0; g < std::min(groups.size(), kMaxPoints); ++g) {
    for (const bool against_seconds : {true, false}) {
      Plot& view = chart.views.emplace_back();
      view.title = groups[g].first;
      view.x_label = against_seconds ? seconds : "step";
      view.y_label = results.value.name;
      view.log_x = view.log_y = true;
      for (const SweepBest* best : groups[g].second) {
        std::vector<Series> runs;
        for (const int point : best->points) {
          Series run = RunCurve(results, point, against_seconds);
          if (!run.x.empty()) runs.push_back(std::move(run));
        }
        if (runs.empty()) continue;
        AddCurve(best->at[results.plan.rule_axis],
                 MedianCurve(runs),
                 runs[0].y[0],
                 &view);
      }
    }
  }
  return chart;
}

// A problem of the profiles is a seed at a point of the grid.
ProfileWork WorkOf(const std::string& name,
                   bool against_seconds,
                   const SweepResults& results,
                   const Groups& groups) {
  ProfileWork work{name, {}};
  for (const auto& group : groups) {
    const size_t first = work.traces.size();
    for (const SweepBest* best : group.second) {
      for (size_t i = 0; i < best->points.size(); ++i) {
        if (work.traces.size() == first + i) {
          work.traces.emplace_back(RulesOf(results).size());
        }
        const Series run = RunCurve(results, best->points[i], against_seconds);
        work.traces[first + i][best->at[results.plan.rule_axis]] = {run.x,
                                                                    run.y};
      }
    }
  }
  return work;
}

std::string Answer(const SweepResults& results,
                   const Groups& groups,
                   const std::vector<HtmlReport::Method>& methods) {
  std::vector<std::pair<std::string, int>> counts;
  counts.reserve(methods.size());
  for (const HtmlReport::Method& method : methods) {
    counts.emplace_back(method.name, 0);
  }
  std::vector<Score> scores;
  for (const auto& group : groups) {
    const SweepBest* lowest = nullptr;
    for (const SweepBest* best : group.second) {
      const double value = best->spread.median;
      const int rule = best->at[results.plan.rule_axis];
      scores.push_back({methods[rule].name,
                        value,
                        best->spread.low,
                        best->spread.Highest(),
                        static_cast<int>(best->spread.num_runs)});
      if (std::isnan(value)) continue;
      if (lowest == nullptr || value < lowest->spread.median) lowest = best;
    }
    if (lowest != nullptr) ++counts[lowest->at[results.plan.rule_axis]].second;
  }
  return groups.size() == 1
             ? AnswerByScores(results.value.name, scores)
             : AnswerByCounts("has the lowest median " + results.value.name,
                              "at",
                              "points of the grid",
                              counts,
                              static_cast<int>(groups.size()));
}

std::vector<std::pair<std::string, std::string>> Facts(
    const SweepResults& results, const std::string& budget) {
  std::vector<std::pair<std::string, std::string>> facts = ProblemFacts();
  for (const GridAxis& axis : results.plan.grid.axes) {
    facts.emplace_back(axis.name,
                       fmt::format("{}", fmt::join(axis.values, ", ")));
  }
  facts.emplace_back("budget", budget + ", each run");
  return facts;
}

}  // namespace

HtmlReport SweepReport(const SweepResults& results,
                       const std::vector<Plot>& lines,
                       const std::vector<Plot>& maps,
                       const std::string& budget,
                       bool is_over) {
  const std::vector<SweepRun>& runs = results.runs;
  const auto num_done = static_cast<size_t>(
      std::count_if(runs.begin(), runs.end(), [](const SweepRun& run) {
        return run.result.has_value();
      }));
  const Groups groups = GroupByPoint(results);
  const auto facts = Facts(results, budget);
  HtmlReport report = NewReport(
      facts[0].second,
      fmt::format("Which of {} rules has the lowest {} at {} points of a grid "
                  "of settings?",
                  RulesOf(results).size(),
                  results.value.name,
                  groups.size()),
      RulesOf(results),
      facts);
  if (!is_over) report.progress = ProgressText(num_done, runs.size());
  if (num_done > 0) report.answer = Answer(results, groups, report.methods);
  for (size_t i = 0; i < runs.size(); ++i) {
    const bool is_there = runs[i].result.has_value();
    if (is_there ? runs[i].result->has_failed()
                 : is_over || !runs[i].status.empty()) {
      report.warnings.push_back(results.plan.jobs[i].name + ": " +
                                runs[i].status);
    }
  }
  if (!lines.empty()) {
    report.charts.push_back(
        {"Along an axis of the grid",
         "The median over the seeds at the end of the runs, with its range.",
         lines});
    for (Plot& view : report.charts.back().views) {
      for (size_t i = 0; i < view.series.size(); ++i) {
        view.series[i].color = static_cast<int>(i);
      }
    }
  }
  report.maps.push_back({"Maps over two axes",
                         "The same colours in all maps, " + results.value.name +
                             ". The lowest rule is framed.",
                         maps});
  report.charts.push_back(CurveChart(results, groups));
  report.charts.push_back(
      ProfileChart("seeds and points of the grid",
                   {WorkOf("seconds", true, results, groups),
                    WorkOf("steps", false, results, groups)}));
  report.sheets.push_back({"The best of every rule",
                           "At every point of the grid, the median over the "
                           "seeds.",
                           SweepTable(results),
                           {results.value.name},
                           {}});
  return report;
}

}  // namespace invgrad
