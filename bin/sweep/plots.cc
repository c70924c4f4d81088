#include "bin/sweep/plots.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "bin/support/program.h"
#include "fmt/core.h"
#include "invgrad/core/specification.h"

namespace invgrad {
namespace {

// An axis of the grid with two values or more, other than rule and seed.
struct ShownAxis {
  int number = 0;  // in the grid
  bool is_numeric = true;
  // The positions of the values, in the order of the grid: the numbers
  // themselves, or 0, 1, 2, ...
  std::vector<double> positions;
  // The distinct positions in ascending order: "1" and "1.0" are one number.
  std::map<double, std::string> labels;

  // Replaces positions by 0 for the lowest, 1 for the next one, ...
  void PutSideBySide() {
    is_numeric = false;
    for (double& position : positions) {
      position = static_cast<double>(
          std::distance(labels.begin(), labels.find(position)));
    }
    std::map<double, std::string> ranked;
    for (const auto& [position, label] : labels) {
      ranked.emplace(static_cast<double>(ranked.size()), label);
    }
    labels = ranked;
  }
};

// Numeric axes first.
std::vector<ShownAxis> ShownAxes(const SweepPlan& plan) {
  std::vector<ShownAxis> shown;
  for (int k = 0; k < static_cast<int>(plan.grid.axes.size()); ++k) {
    const auto& [name, values] = plan.grid.axes[k];
    if (k == plan.rule_axis || k == plan.seed_axis || values.size() < 2) {
      continue;
    }
    ShownAxis axis;
    axis.number = k;
    for (const std::string& value : values) {
      double number = 0.0;
      axis.is_numeric = axis.is_numeric && ParseFinite(value, &number);
      if (plan.jobs[0].is_training() && name == "batch_size" &&
          number == 0.0) {  // all samples
        number = plan.jobs[0].learning().train.num_samples();
      }
      axis.positions.push_back(number);
    }
    for (size_t i = 0; i < values.size(); ++i) {
      if (!axis.is_numeric) axis.positions[i] = static_cast<double>(i);
      axis.labels.emplace(axis.positions[i], values[i]);
    }
    shown.push_back(axis);
  }
  std::stable_partition(shown.begin(), shown.end(), [](const ShownAxis& axis) {
    return axis.is_numeric;
  });
  return shown;
}

// A margin on both sides keeps points off the frame.
AxisRange WithMargin(const std::vector<double>& values, bool is_log) {
  constexpr double kMargin = 0.04;
  AxisRange range = RangeOf(values, is_log);
  const double low = *range.low, high = *range.high;
  if (low == high) return {};
  if (is_log) {
    const double factor = std::pow(high / low, kMargin);
    return {low / factor, high * factor};
  }
  const double margin = kMargin * (high - low);
  return {low - margin, high + margin};
}

// More than a decade, and all positive.
bool NeedsLogScale(const std::vector<double>& values) {
  const AxisRange range = RangeOf(values, false);
  return *range.low > 0.0 && *range.high > 10.0 * *range.low;
}

// Whether no scale can separate the numbers, such as 0, 1e-6 and 1.
bool SpansDecadesAndZero(const std::vector<double>& values) {
  std::vector<double> positive;
  for (const double value : values) {
    if (value > 0.0) positive.push_back(value);
  }
  return positive.size() < values.size() && !positive.empty() &&
         *std::max_element(positive.begin(), positive.end()) >
             100.0 * *std::min_element(positive.begin(), positive.end());
}

std::vector<double> Medians(const std::vector<SweepBest>& best) {
  std::vector<double> medians;
  medians.reserve(best.size());
  for (const SweepBest& one : best) medians.push_back(one.spread.median);
  return medians;
}

std::vector<std::string> RuleTitles(const SweepPlan& plan) {
  return ShortNames(plan.grid.axes[plan.rule_axis].values);
}

// The points that agree in all axes but those that a panel shows.
struct PanelPoints {
  std::string title;  // "xi=32, phi=45"
  std::vector<const SweepBest*> points;
};

// Warns if `picture` must leave panels out.
std::vector<PanelPoints> GroupByPanel(const std::string& picture,
                                      const SweepPlan& plan,
                                      const std::vector<SweepBest>& best,
                                      const std::set<int>& shown) {
  std::map<std::vector<int>, PanelPoints> panels;
  for (const SweepBest& one : best) {
    std::vector<int> at = one.at;
    for (const int k : shown) at[k] = 0;
    panels[at].points.push_back(&one);
  }
  std::vector<PanelPoints> grouped;
  for (auto& [at, panel] : panels) {
    for (int k = 0; k < static_cast<int>(at.size()); ++k) {
      const GridAxis& axis = plan.grid.axes[k];
      if (shown.count(k) > 0 || k == plan.rule_axis || axis.values.size() < 2) {
        continue;
      }
      panel.title += fmt::format("{}{}={}",
                                 panel.title.empty() ? "" : ", ",
                                 axis.name,
                                 axis.values[at[k]]);
    }
    grouped.push_back(std::move(panel));
  }
  constexpr size_t kMaxPanels = 16;
  if (grouped.size() > kMaxPanels) {
    Warn(fmt::format(
        "{} shows the first {} of {} panels; sweep.csv has all results",
        picture,
        kMaxPanels,
        grouped.size()));
    grouped.resize(kMaxPanels);
  }
  return grouped;
}

}  // namespace

std::vector<Plot> SweepLines(const SweepResults& results) {
  const SweepPlan& plan = results.plan;
  const std::vector<ShownAxis> axes = ShownAxes(plan);
  if (axes.empty()) return {};
  ShownAxis x = axes[0];
  if (x.is_numeric && SpansDecadesAndZero(x.positions)) x.PutSideBySide();
  Plot all;  // what the panels have in common
  all.x_label = plan.grid.axes[x.number].name;
  all.y_label = results.value.name;
  all.log_x = x.is_numeric && NeedsLogScale(x.positions);
  all.x_range =
      x.is_numeric
          ? WithMargin(x.positions, all.log_x)
          : AxisRange{-0.5, static_cast<double>(x.labels.size()) - 0.5};
  all.x_ticks.assign(x.labels.begin(), x.labels.end());
  all.log_y = NeedsLogScale(Medians(results.best));
  std::vector<double> ys;
  for (const SweepBest& one : results.best) {
    ys.insert(ys.end(), {one.spread.low, one.spread.high});
  }
  all.y_range = WithMargin(ys, all.log_y);
  std::vector<Plot> plots;
  const std::vector<std::string> titles = RuleTitles(plan);
  const std::set<int> shown = {x.number, plan.rule_axis, plan.seed_axis};
  for (const auto& [title, points] :
       GroupByPanel("lines.png", plan, results.best, shown)) {
    Plot& plot = plots.emplace_back(all);
    plot.title = title;
    for (size_t rule = 0; rule < titles.size(); ++rule) {
      std::map<double, const SeedSpread*> spreads;
      for (const SweepBest* point : points) {
        if (point->at[plan.rule_axis] == static_cast<int>(rule)) {
          spreads[x.positions[point->at[x.number]]] = &point->spread;
        }
      }
      Series& series = plot.series.emplace_back();
      series.title = titles[rule];
      series.style = Series::Style::kLinesAndPoints;
      for (const auto& [at_x, spread] : spreads) {
        series.x.push_back(at_x);
        series.y.push_back(spread->median);
        series.y_low.push_back(spread->low);
        series.y_high.push_back(spread->high);
      }
    }
  }
  return plots;
}

std::vector<Plot> SweepHeatMaps(const SweepResults& results) {
  const SweepPlan& plan = results.plan;
  std::vector<ShownAxis> axes = ShownAxes(plan);
  if (axes.size() < 2 || !axes[1].is_numeric) return {};
  ShownAxis& x = axes[0];
  ShownAxis& y = axes[1];
  HeatMap map;
  map.z_label = results.value.name;
  map.log_z = NeedsLogScale(Medians(results.best));
  map.z_range = RangeOf(Medians(results.best), map.log_z);
  x.PutSideBySide();
  y.PutSideBySide();
  std::vector<Plot> plots;
  const std::vector<std::string> titles = RuleTitles(plan);
  const std::set<int> shown = {x.number, y.number, plan.seed_axis};
  for (const auto& [title, points] :
       GroupByPanel("heat_map.png", plan, results.best, shown)) {
    Plot& plot = plots.emplace_back();
    plot.title = titles[points[0]->at[plan.rule_axis]];
    if (!title.empty()) plot.title += ", " + title;
    plot.x_label = plan.grid.axes[x.number].name;
    plot.y_label = plan.grid.axes[y.number].name;
    plot.x_ticks.assign(x.labels.begin(), x.labels.end());
    plot.y_ticks.assign(y.labels.begin(), y.labels.end());
    map.z.setConstant(y.labels.size(), x.labels.size(), HistoryRow::kNone);
    for (const SweepBest* point : points) {
      map.z(static_cast<Eigen::Index>(y.positions[point->at[y.number]]),
            static_cast<Eigen::Index>(x.positions[point->at[x.number]])) =
          point->spread.median;
    }
    plot.heat_map = map;
  }
  return plots;
}

std::vector<Plot> SweepCurves(const SweepResults& results) {
  const SweepPlan& plan = results.plan;
  std::vector<Plot> plots;
  std::vector<double> values;  // of all panels, so that they compare
  const std::vector<std::string> titles = RuleTitles(plan);
  for (const auto& [title, points] :
       GroupByPanel("curves.png",
                    plan,
                    results.best,
                    {plan.rule_axis, plan.seed_axis})) {
    Plot& plot = plots.emplace_back();
    plot.title = title;
    plot.x_label = "seconds of training";
    plot.y_label = results.value.name;
    plot.log_x = true;
    for (const SweepBest* point : points) {
      const SweepRun& run =
          results.runs[plan.points[point->median_point()].job];
      Series curve = HistoryCurve(titles[point->at[plan.rule_axis]],
                                  run.result ? run.result->history : History(),
                                  results.value.field,
                                  /*against_seconds=*/true);
      curve.color = point->at[plan.rule_axis];
      EndFailedCurve(run.result && run.result->has_failed(), &curve);
      values.insert(values.end(), curve.y.begin(), curve.y.end());
      plot.series.push_back(curve);
    }
  }
  for (Plot& plot : plots) {
    plot.log_y = NeedsLogScale(values);
    plot.y_range = WithMargin(values, plot.log_y);
  }
  return plots;
}

}  // namespace invgrad
