#include "bin/fresh_samples/results.h"

#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <utility>

#include "bin/fresh_samples/agreement.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

Table GridCsv(const std::vector<FreshGridPoint>& points) {
  Table table;
  for (const FreshGridPoint& point : points) {
    table.BeginRow();
    table.Add("from", std::to_string(point.from));
    table.Add("step", std::to_string(point.step));
    table.Add("kappa", ExactNumber(point.kappa));
    table.Add("relative_damping", ExactNumber(point.damping));
    table.Add("judged_damping", ExactNumber(point.judged));
    table.Add("step_size", ExactNumber(point.decrease.step_size));
    table.Add("predicted", ExactNumber(point.decrease.predicted));
    table.Add("linear", ExactNumber(point.decrease.linear));
    table.Add("measured", ExactNumber(point.decrease.measured));
    table.Add("measured_test", ExactNumber(point.decrease.measured_test));
    table.Add("gamma", ExactNumber(point.generalization));
    table.Add("noise_scale", ExactNumber(point.noise_scale));
  }
  return table;
}

Table RuleCsv(const std::vector<FreshRulePoint>& points) {
  Table table;
  for (const FreshRulePoint& point : points) {
    table.BeginRow();
    table.Add("step", std::to_string(point.step));
    table.Add("loss", ExactNumber(point.loss));
    table.Add("kappa", ExactNumber(point.filter.kappa));
    table.Add("noise", ExactNumber(point.filter.noise));
    table.Add("gamma", ExactNumber(point.generalization));
    const auto add = [&table](const std::string& name,
                              const FreshDecrease& decrease) {
      table.Add(name + "_step_size", ExactNumber(decrease.step_size));
      table.Add(name + "_predicted", ExactNumber(decrease.predicted));
      table.Add(name + "_linear", ExactNumber(decrease.linear));
      table.Add(name + "_measured", ExactNumber(decrease.measured));
      table.Add(name + "_measured_test", ExactNumber(decrease.measured_test));
    };
    add("best", point.best_step);
    add("rules", point.rules_step);
  }
  return table;
}

// The means over the steps of each filter, in ascending order of filters.
std::vector<FreshGridPoint> Means(const std::vector<FreshGridPoint>& points,
                                  int from) {
  std::map<std::pair<double, double>, std::pair<FreshGridPoint, int>> by_filter;
  constexpr double FreshDecrease::*kValues[] = {&FreshDecrease::predicted,
                                                &FreshDecrease::linear,
                                                &FreshDecrease::measured};
  for (const FreshGridPoint& point : points) {
    if (point.from != from) continue;
    auto& [sum, count] = by_filter[{point.kappa, point.damping}];
    if (++count == 1) {
      sum = point;
      continue;
    }
    for (const auto value : kValues) {
      sum.decrease.*value += point.decrease.*value;
    }
  }
  std::vector<FreshGridPoint> means;
  for (const auto& [filter, sum_and_count] : by_filter) {
    FreshGridPoint& mean = means.emplace_back(sum_and_count.first);
    for (const auto value : kValues) {
      mean.decrease.*value /= sum_and_count.second;
    }
  }
  return means;
}

// How well predictions order the linear and the measured decreases, and the
// median of measured / predicted.
void AddAgreement(const std::vector<double>& predicted,
                  const std::vector<double>& linear,
                  const std::vector<double>& measured,
                  Table* table) {
  const Agreement agreement(predicted, measured);
  table->Add("pairs", std::to_string(agreement.num_pairs));
  table->Add("rank corr. linear",
             NumberOrDash(Agreement(predicted, linear).rank_correlation));
  table->Add("rank corr. measured", NumberOrDash(agreement.rank_correlation));
  table->Add("measured/predicted", NumberOrDash(agreement.median_ratio));
}

// For each step: how well the grid's predictions agree with what was measured,
// and what choosing by prediction gives.
Table GridTable(const std::vector<int>& at,
                const std::vector<FreshGridPoint>& points) {
  Table table;
  for (const int from : at) {
    std::vector<double> predicted, linear, measured;
    const FreshGridPoint* chosen = nullptr;
    const FreshGridPoint* best = nullptr;
    for (const FreshGridPoint& point : points) {
      if (point.from != from) continue;
      predicted.push_back(point.decrease.predicted);
      linear.push_back(point.decrease.linear);
      measured.push_back(point.decrease.measured);
      if (chosen == nullptr || predicted.back() > chosen->decrease.predicted) {
        chosen = &point;
      }
      if (best == nullptr || measured.back() > best->decrease.measured) {
        best = &point;
      }
    }
    if (chosen == nullptr) continue;
    const auto filter = [](const FreshGridPoint& point) {
      return fmt::format("{:g}, {:g}", point.kappa, point.damping);
    };
    table.BeginRow();
    table.Add("from step", std::to_string(from));
    table.Add("noise scale", NumberOrDash(chosen->noise_scale));
    AddAgreement(predicted, linear, measured, &table);
    table.Add("chosen kappa, damping", filter(*chosen));
    table.Add("gamma", NumberOrDash(chosen->generalization));
    table.Add("predicted", NumberOrDash(chosen->decrease.predicted));
    table.Add("linear", NumberOrDash(chosen->decrease.linear));
    table.Add("measured", NumberOrDash(chosen->decrease.measured));
    table.Add("best kappa, damping", filter(*best));
    table.Add("its measured", NumberOrDash(best->decrease.measured));
  }
  return table;
}

// The steps between those of --at.
struct Span {
  std::string title;
  std::vector<FreshRulePoint> points;
};

std::vector<Span> Spans(std::vector<int> ends,
                        const std::vector<FreshRulePoint>& points) {
  std::vector<Span> spans;
  ends.push_back(std::numeric_limits<int>::max());
  long first = 0;
  for (const int end : ends) {
    Span span;
    for (const FreshRulePoint& point : points) {
      if (point.step >= first && point.step < end) span.points.push_back(point);
    }
    first = end;
    if (span.points.empty()) continue;
    span.title = fmt::format(
        "steps {} to {}", span.points.front().step, span.points.back().step);
    spans.push_back(span);
  }
  return spans;
}

std::vector<double> ValuesOf(const Span& span,
                             FreshDecrease FreshRulePoint::*decrease,
                             double FreshDecrease::*value) {
  std::vector<double> values;
  for (const FreshRulePoint& point : span.points) {
    values.push_back(point.*decrease.*value);
  }
  return values;
}

constexpr struct {
  const char* step_size;
  FreshDecrease FreshRulePoint::*decrease;
} kStepSizes[] = {{"best for fresh samples", &FreshRulePoint::best_step},
                  {"the rule's", &FreshRulePoint::rules_step}};

Table RuleTable(const std::vector<Span>& spans) {
  Table table;
  for (const auto& [step_size, decrease] : kStepSizes) {
    for (const Span& span : spans) {
      const auto predicted =
          ValuesOf(span, decrease, &FreshDecrease::predicted);
      const auto linear = ValuesOf(span, decrease, &FreshDecrease::linear);
      const auto measured = ValuesOf(span, decrease, &FreshDecrease::measured);
      std::vector<double> gammas;
      for (const FreshRulePoint& point : span.points) {
        gammas.push_back(point.generalization);
      }
      table.BeginRow();
      table.Add("step size", step_size, Table::Align::kLeft);
      table.Add("steps", span.title, Table::Align::kLeft);
      AddAgreement(predicted, linear, measured, &table);
      table.Add("gamma", NumberOrDash(SeedSpread(gammas).median));
      table.Add("predicted", NumberOrDash(SeedSpread(predicted).median));
      table.Add("linear", NumberOrDash(SeedSpread(linear).median));
      table.Add("measured", NumberOrDash(SeedSpread(measured).median));
    }
  }
  return table;
}

// From half the highest decrease below zero: harm has no bound.
AxisRange RangeUpTo(double highest) {
  if (!(highest > 0.0)) return {};
  return {-0.5 * highest, highest};
}

std::vector<Plot> GridPlots(const std::vector<int>& at,
                            const std::vector<FreshGridPoint>& points) {
  std::vector<Plot> plots;
  for (const int from : at) {
    Plot plot;
    plot.title =
        fmt::format("from step {}: lines predicted, points measured", from);
    plot.x_label = "damping / s_max^2";
    plot.y_label = "decrease of the loss of fresh samples";
    plot.log_x = true;
    double highest = 0.0;
    for (const double kappa : kFreshKappas) {
      Series predicted, measured;
      predicted.title = fmt::format("kappa {:g}", kappa);
      measured.style = Series::Style::kPoints;
      predicted.color = measured.color =
          static_cast<int>(plot.series.size() / 2);
      for (const FreshGridPoint& point : points) {
        if (point.from != from || point.kappa != kappa) continue;
        highest = std::fmax(highest, point.decrease.predicted);
        highest = std::fmax(highest, point.decrease.measured);
        predicted.x.push_back(point.damping);
        predicted.y.push_back(point.decrease.predicted);
        measured.x.push_back(point.damping);
        measured.y.push_back(point.decrease.measured);
      }
      if (predicted.x.empty()) continue;
      plot.series.push_back(predicted);
      plot.series.push_back(measured);
    }
    plot.y_range = RangeUpTo(1.1 * highest);
    if (!plot.series.empty()) plots.push_back(plot);
  }
  return plots;
}

std::vector<Plot> RulePlots(const std::vector<Span>& spans) {
  std::vector<Plot> plots;
  for (const auto& [name, value] :
       {std::pair("measured", &FreshDecrease::measured),
        std::pair("linear model", &FreshDecrease::linear)}) {
    for (const auto& [step_size, decrease] : kStepSizes) {
      Plot& plot = plots.emplace_back();
      plot.title = fmt::format("step size {}", step_size);
      plot.x_label = "predicted decrease";
      plot.y_label = fmt::format("decrease of fresh samples, {}", name);
      double highest = 0.0;
      for (const Span& span : spans) {
        Series& series = plot.series.emplace_back();
        series.title = span.title;
        series.style = Series::Style::kPoints;
        series.x = ValuesOf(span, decrease, &FreshDecrease::predicted);
        series.y = ValuesOf(span, decrease, value);
        for (const double x : series.x) highest = std::fmax(highest, x);
      }
      Series& equal = plot.series.emplace_back();
      equal.title = "equal";
      equal.is_muted = true;
      plot.x_range = plot.y_range = RangeUpTo(1.1 * highest);
      equal.x = equal.y = {-0.55 * highest, 1.1 * highest};
    }
  }
  return plots;
}

}  // namespace

bool WriteFreshResults(const std::string& folder,
                       const std::vector<int>& at,
                       const FreshResults& results,
                       std::string* error) {
  const std::vector<Span> spans = Spans(at, results.rule);
  std::vector<FreshGridPoint> means;
  for (const int from : at) {
    const std::vector<FreshGridPoint> some = Means(results.grid, from);
    means.insert(means.end(), some.begin(), some.end());
  }
  const Table grid = GridTable(at, means);
  const Table rule = RuleTable(spans);
  std::cout << "Grid, by steps of the step size that is best for fresh "
               "samples: means\n\n"
            << grid.ToText() << "\nFilter of the rule, medians\n\n"
            << rule.ToText();
  if (!WriteRunFile(
          folder + "fresh_samples.csv", GridCsv(results.grid).ToCsv(), error) ||
      !WriteRunFile(
          folder + "calibration.csv", RuleCsv(results.rule).ToCsv(), error) ||
      !WriteTable(folder + "fresh_samples", grid, error) ||
      !WriteTable(folder + "calibration", rule, error)) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  DrawPictures({{folder + "fresh_samples.png", GridPlots(at, means)},
                {folder + "calibration.png", RulePlots(spans)}});
  return true;
}

}  // namespace invgrad
