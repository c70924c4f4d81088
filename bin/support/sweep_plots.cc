#include "bin/support/sweep_plots.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "bin/support/program.h"

namespace invgrad {

namespace {

constexpr size_t kMaxPanels = 16;

struct NumericAxis {
  int number = 0;  // in the grid
  std::string name;
  std::vector<double> values;  // as in the grid, not sorted
};

std::vector<NumericAxis> NumericAxes(const SweepPlan& plan) {
  std::vector<NumericAxis> numeric;
  for (int k = 0; k < static_cast<int>(plan.grid.axes.size()); ++k) {
    const GridAxis& axis = plan.grid.axes[k];
    if (k == plan.rule_axis || k == plan.seed_axis || axis.values.size() < 2) {
      continue;
    }
    NumericAxis candidate{k, axis.name, {}};
    for (const GridValue& value : axis.values) {
      double number = 0.0;
      if (!ParseFinite(value.text, &number)) break;
      if (axis.name == "batch_size" && number == 0.0) {  // all samples
        number = plan.jobs[0].problem->train.num_samples();
      }
      candidate.values.push_back(number);
    }
    if (candidate.values.size() == axis.values.size()) {
      numeric.push_back(candidate);
    }
  }
  return numeric;
}

// More than a decade, and all that is finite is positive.
bool NeedsLogScale(const std::vector<double>& values) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return low > 0.0 && high > 10.0 * low;
}

// Ascending, none twice: "1" and "1.0" are one number.
std::vector<double> Sorted(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

// What lines are drawn against.
struct LineAxis {
  int number = 0;  // in the grid
  std::string name;
  bool is_numeric = false;        // or the values stand side by side
  std::vector<double> positions;  // as in the grid
};

// Whether no scale tells the numbers apart: 0 beside 1e-6 and 1, say.
bool SpansDecadesAndZero(const std::vector<double>& values) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  bool has_zero = false;
  for (const double value : values) {
    has_zero = has_zero || value <= 0.0;
    if (value > 0.0) low = std::min(low, value);
    high = std::max(high, std::abs(value));
  }
  return has_zero && high > 100.0 * low;
}

// 0 for the lowest, 1 for the next one, ...
std::vector<double> Ranks(const std::vector<double>& values) {
  const std::vector<double> sorted = Sorted(values);
  std::vector<double> ranks;
  ranks.reserve(values.size());
  for (const double value : values) {
    ranks.push_back(static_cast<double>(
        std::lower_bound(sorted.begin(), sorted.end(), value) -
        sorted.begin()));
  }
  return ranks;
}

// Nothing if the grid has only rules and seeds.
std::optional<LineAxis> FindLineAxis(const SweepPlan& plan) {
  const std::vector<NumericAxis> numeric = NumericAxes(plan);
  if (!numeric.empty()) {
    const NumericAxis& first = numeric[0];
    return SpansDecadesAndZero(first.values)
               ? LineAxis{first.number, first.name, false, Ranks(first.values)}
               : LineAxis{first.number, first.name, true, first.values};
  }
  for (int k = 0; k < static_cast<int>(plan.grid.axes.size()); ++k) {
    const GridAxis& axis = plan.grid.axes[k];
    if (k == plan.rule_axis || k == plan.seed_axis || axis.values.size() < 2) {
      continue;
    }
    LineAxis line{k, axis.name, false, {}};
    for (size_t i = 0; i < axis.values.size(); ++i) {
      line.positions.push_back(static_cast<double>(i));
    }
    return line;
  }
  return std::nullopt;
}

// From the lowest to the highest of the finite values, with a margin that keeps
// the points off the frame. Nothing if there are no two of them.
AxisRange RangeWithMargin(const std::vector<double>& values, bool is_log) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, is_log ? std::log(value) : value);
    high = std::max(high, is_log ? std::log(value) : value);
  }
  if (low >= high) return AxisRange();
  constexpr double kMargin = 0.04;
  const double margin = kMargin * (high - low);
  AxisRange range{low - margin, high + margin};
  if (is_log) range = {std::exp(*range.low), std::exp(*range.high)};
  return range;
}

// Ticks and range of an axis that shows what was tried.
void SetLineAxis(const SweepPlan& plan, const LineAxis& x, Plot* plot) {
  plot->x_label = x.name;
  plot->log_x = x.is_numeric && NeedsLogScale(x.positions);
  if (x.is_numeric) {
    plot->x_range = RangeWithMargin(x.positions, plot->log_x);
  } else {
    plot->x_range = {-0.5, static_cast<double>(x.positions.size()) - 0.5};
  }
  const std::vector<GridValue>& values = plan.grid.axes[x.number].values;
  for (size_t i = 0; i < values.size(); ++i) {
    plot->x_ticks.emplace_back(x.positions[i], values[i].text);
  }
  std::sort(plot->x_ticks.begin(), plot->x_ticks.end());
}

// Of all panels, so that they compare.
AxisRange RangeOfCells(const std::vector<SweepBest>& best, bool is_log) {
  std::vector<double> values;
  for (const SweepBest& one : best) {
    for (const double value : {one.cell.low, one.cell.median, one.cell.high}) {
      if (!is_log || value > 0.0) values.push_back(value);
    }
  }
  return RangeWithMargin(values, is_log);
}

// "xi=32, phi=45": where a panel stands, but for the axes that it shows.
std::string PointText(const SweepPlan& plan,
                      const std::vector<int>& at,
                      const std::set<int>& shown) {
  std::string text;
  for (int k = 0; k < static_cast<int>(at.size()); ++k) {
    const GridAxis& axis = plan.grid.axes[k];
    if (shown.count(k) > 0 || axis.values.size() < 2) continue;
    text +=
        (text.empty() ? "" : ", ") + axis.name + "=" + axis.values[at[k]].text;
  }
  return text;
}

// Of the rules: without what they chose between, if that tells them apart.
std::vector<std::string> RuleTitles(const SweepPlan& plan) {
  std::vector<std::string> titles;
  for (const GridValue& rule : plan.grid.axes[plan.rule_axis].values) {
    titles.push_back(WithoutAlternatives(rule.text));
  }
  std::vector<std::string> unique = titles;
  for (size_t i = 0; i < titles.size(); ++i) {
    if (std::count(titles.begin(), titles.end(), titles[i]) > 1) {
      unique[i] = plan.grid.axes[plan.rule_axis].values[i].text;
    }
  }
  return unique;
}

// The best of the points that agree in all axes but `shown`.
using Panels = std::map<std::vector<int>, std::vector<const SweepBest*>>;

// Warns if `picture` must leave panels out.
Panels GroupByPanel(const std::string& picture,
                    const std::vector<SweepBest>& best,
                    const std::set<int>& shown) {
  Panels panels;
  for (const SweepBest& one : best) {
    std::vector<int> at = one.at;
    for (const int k : shown) at[k] = 0;
    panels[at].push_back(&one);
  }
  if (panels.size() > kMaxPanels) {
    Warn(picture + " shows the first " + std::to_string(kMaxPanels) + " of " +
         std::to_string(panels.size()) + " panels; sweep.csv has all results");
    panels.erase(std::next(panels.begin(), kMaxPanels), panels.end());
  }
  return panels;
}

std::vector<double> Medians(const std::vector<SweepBest>& best) {
  std::vector<double> medians;
  medians.reserve(best.size());
  for (const SweepBest& one : best) medians.push_back(one.cell.median);
  return medians;
}

bool DrawIfAny(const std::string& file,
               const std::vector<Plot>& plots,
               std::string* error) {
  // An earlier picture, of less of the grid, must not pass for this one.
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  return plots.empty() || WritePlots(file, plots, error);
}

}  // namespace

std::vector<Plot> SweepLines(const SweepPlan& plan,
                             const SweepValue& value,
                             const std::vector<SweepBest>& best) {
  std::vector<Plot> plots;
  const std::optional<LineAxis> axis = FindLineAxis(plan);
  if (!axis.has_value()) return plots;
  const LineAxis& x = *axis;
  const std::vector<std::string> titles = RuleTitles(plan);
  const bool log_y = NeedsLogScale(Medians(best));
  const AxisRange y_range = RangeOfCells(best, log_y);
  const std::set<int> shown = {x.number, plan.rule_axis, plan.seed_axis};
  for (const auto& [at, points] : GroupByPanel("lines.png", best, shown)) {
    Plot plot;
    plot.title = PointText(plan, at, shown);
    plot.y_label = value.name;
    SetLineAxis(plan, x, &plot);
    plot.log_y = log_y;
    plot.y_range = y_range;
    for (size_t rule = 0; rule < titles.size(); ++rule) {
      std::vector<std::pair<double, const SweepCell*>> cells;
      for (const SweepBest* point : points) {
        if (point->at[plan.rule_axis] == static_cast<int>(rule)) {
          cells.emplace_back(x.positions[point->at[x.number]], &point->cell);
        }
      }
      std::sort(cells.begin(), cells.end());
      Series series;
      series.title = titles[rule];
      series.style = Series::Style::kLinesAndPoints;
      for (const auto& [at_x, cell] : cells) {
        series.x.push_back(at_x);
        series.y.push_back(cell->median);
        series.y_low.push_back(cell->low);
        series.y_high.push_back(cell->high);
      }
      plot.series.push_back(series);
    }
    plot.legend = Plot::Legend::kNone;
    plots.push_back(plot);
  }
  // One legend is enough: it stands beside the last panel.
  plots.back().legend =
      plots.size() > 1 ? Plot::Legend::kOutside : Plot::Legend::kAuto;
  return plots;
}

std::vector<Plot> SweepHeatMaps(const SweepPlan& plan,
                                const SweepValue& value,
                                const std::vector<SweepBest>& best) {
  std::vector<Plot> plots;
  const std::vector<NumericAxis> numeric = NumericAxes(plan);
  if (numeric.size() < 2) return plots;
  const NumericAxis& x = numeric[0];
  const NumericAxis& y = numeric[1];
  HeatMap map;
  map.x = Sorted(x.values);
  map.y = Sorted(y.values);
  map.equal_cells = true;
  map.z_label = value.name;
  const std::vector<double> medians = Medians(best);
  map.log_z = NeedsLogScale(medians);
  for (const double median : medians) {
    if (std::isnan(median)) continue;
    map.z_range.low = std::min(map.z_range.low.value_or(median), median);
    map.z_range.high = std::max(map.z_range.high.value_or(median), median);
  }
  if (map.z_range.low == map.z_range.high) map.z_range = AxisRange();
  const auto index = [](const std::vector<double>& sorted, double number) {
    return std::lower_bound(sorted.begin(), sorted.end(), number) -
           sorted.begin();
  };
  const std::vector<std::string> titles = RuleTitles(plan);
  const std::set<int> shown = {x.number, y.number, plan.seed_axis};
  std::set<int> in_title = shown;
  in_title.insert(plan.rule_axis);
  for (const auto& [at, points] : GroupByPanel("heat_map.png", best, shown)) {
    Plot plot;
    const std::string where = PointText(plan, at, in_title);
    plot.title =
        titles[at[plan.rule_axis]] + (where.empty() ? "" : ", " + where);
    plot.x_label = x.name;
    plot.y_label = y.name;
    map.z.setConstant(map.y.size(), map.x.size(), HistoryRow::kNone);
    for (const SweepBest* point : points) {
      map.z(index(map.y, y.values[point->at[y.number]]),
            index(map.x, x.values[point->at[x.number]])) = point->cell.median;
    }
    plot.heat_map = map;
    plots.push_back(plot);
  }
  return plots;
}

std::vector<Plot> SweepCurves(const SweepPlan& plan,
                              const std::vector<SweepRun>& runs,
                              const SweepValue& value,
                              const std::vector<SweepBest>& best) {
  std::vector<Plot> plots;
  std::vector<double> values;  // of all panels, so that they compare
  const std::set<int> shown = {plan.rule_axis, plan.seed_axis};
  for (const auto& [at, points] : GroupByPanel("curves.png", best, shown)) {
    Plot plot;
    plot.title = PointText(plan, at, shown);
    plot.x_label = "seconds of training";
    plot.y_label = value.name;
    plot.log_x = true;
    for (const SweepBest* point : points) {
      const SweepRun& run = runs[plan.points[point->cell.median_point].job];
      Series series;
      series.title = point->alternative->specification;
      series.color = point->at[plan.rule_axis];
      if (run.result.has_value()) {
        for (const HistoryRow& row : run.result->history) {
          // The start has no place on a logarithmic axis.
          if (row.step == 0) continue;
          series.x.push_back(row.seconds);
          series.y.push_back(row.*value.field);
        }
      }
      if (series.x.size() == 1) series.style = Series::Style::kPoints;
      values.insert(values.end(), series.y.begin(), series.y.end());
      plot.series.push_back(series);
    }
    plots.push_back(plot);
  }
  for (Plot& plot : plots) {
    plot.log_y = NeedsLogScale(values);
    plot.y_range = RangeWithMargin(values, plot.log_y);
  }
  return plots;
}

bool DrawSweep(const std::string& directory,
               const SweepPlan& plan,
               const std::vector<SweepRun>& runs,
               const SweepValue& value,
               const std::vector<SweepBest>& best,
               std::string* error) {
  return DrawIfAny(
             directory + "/lines.png", SweepLines(plan, value, best), error) &&
         DrawIfAny(directory + "/heat_map.png",
                   SweepHeatMaps(plan, value, best),
                   error) &&
         DrawIfAny(directory + "/curves.png",
                   SweepCurves(plan, runs, value, best),
                   error);
}

}  // namespace invgrad
