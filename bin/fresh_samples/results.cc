#include "bin/fresh_samples/results.h"

#include <iostream>
#include <limits>

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
    table.Add("step", std::to_string(point.step));
    table.Add("kappa", ExactNumber(point.kappa));
    table.Add("relative_damping", ExactNumber(point.damping));
    table.Add("judged_damping", ExactNumber(point.judged));
    table.Add("step_size", ExactNumber(point.decrease.step_size));
    table.Add("predicted", ExactNumber(point.decrease.predicted));
    table.Add("measured", ExactNumber(point.decrease.measured));
    table.Add("measured_test", ExactNumber(point.decrease.measured_test));
    table.Add("gamma", ExactNumber(point.generalization));
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
      table.Add(name + "_measured", ExactNumber(decrease.measured));
      table.Add(name + "_measured_test", ExactNumber(decrease.measured_test));
    };
    add("best", point.best_step);
    add("rules", point.rules_step);
  }
  return table;
}

// For each step: how well the grid's predictions agree with what was measured,
// and what choosing by prediction gives.
Table GridTable(const std::vector<int>& at,
                const std::vector<FreshGridPoint>& points) {
  Table table;
  for (const int step : at) {
    std::vector<double> predicted, measured;
    const FreshGridPoint* chosen = nullptr;
    const FreshGridPoint* best = nullptr;
    for (const FreshGridPoint& point : points) {
      if (point.step != step) continue;
      predicted.push_back(point.decrease.predicted);
      measured.push_back(point.decrease.measured);
      if (chosen == nullptr || predicted.back() > chosen->decrease.predicted) {
        chosen = &point;
      }
      if (best == nullptr || measured.back() > best->decrease.measured) {
        best = &point;
      }
    }
    if (chosen == nullptr) continue;
    const Agreement agreement(predicted, measured);
    const auto filter = [](const FreshGridPoint& point) {
      return fmt::format("{:g}, {:g}", point.kappa, point.damping);
    };
    table.BeginRow();
    table.Add("step", std::to_string(step));
    table.Add("rank correlation", NumberOrDash(agreement.rank_correlation));
    table.Add("measured/predicted", NumberOrDash(agreement.median_ratio));
    table.Add("chosen kappa, damping", filter(*chosen));
    table.Add("gamma", NumberOrDash(chosen->generalization));
    table.Add("predicted", NumberOrDash(chosen->decrease.predicted));
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

// The decreases of a span, predicted as x and measured as y.
Series DecreasesOf(const Span& span, FreshDecrease FreshRulePoint::*decrease) {
  Series series;
  series.title = span.title;
  series.style = Series::Style::kPoints;
  for (const FreshRulePoint& point : span.points) {
    series.x.push_back((point.*decrease).predicted);
    series.y.push_back((point.*decrease).measured);
  }
  return series;
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
      const Series series = DecreasesOf(span, decrease);
      const Agreement agreement(series.x, series.y);
      std::vector<double> gammas;
      for (const FreshRulePoint& point : span.points) {
        gammas.push_back(point.generalization);
      }
      table.BeginRow();
      table.Add("step size", step_size, Table::Align::kLeft);
      table.Add("steps", span.title, Table::Align::kLeft);
      table.Add("pairs", std::to_string(agreement.num_pairs));
      table.Add("gamma", NumberOrDash(SeedSpread(gammas).median));
      table.Add("predicted", NumberOrDash(SeedSpread(series.x).median));
      table.Add("measured", NumberOrDash(SeedSpread(series.y).median));
      table.Add("rank correlation", NumberOrDash(agreement.rank_correlation));
      table.Add("measured/predicted", NumberOrDash(agreement.median_ratio));
    }
  }
  return table;
}

// Below this a picture shows no decrease: harm has no bound.
constexpr double kLowest = -0.5;

std::vector<Plot> GridPlots(const std::vector<int>& at,
                            const std::vector<FreshGridPoint>& points) {
  std::vector<Plot> plots;
  for (const int step : at) {
    Plot plot;
    plot.title = fmt::format("after {} steps", step);
    plot.x_label = "damping / s_max^2";
    plot.y_label = "decrease of the loss of fresh samples";
    plot.log_x = true;
    plot.y_range = {kLowest, 1.0};
    for (const double kappa : kFreshKappas) {
      Series predicted, measured;
      predicted.title = fmt::format("kappa {:g}", kappa);
      measured.style = Series::Style::kPoints;
      predicted.color = measured.color =
          static_cast<int>(plot.series.size() / 2);
      for (const FreshGridPoint& point : points) {
        if (point.step != step || point.kappa != kappa) continue;
        predicted.x.push_back(point.damping);
        predicted.y.push_back(point.decrease.predicted);
        measured.x.push_back(point.damping);
        measured.y.push_back(point.decrease.measured);
      }
      if (predicted.x.empty()) continue;
      plot.series.push_back(predicted);
      plot.series.push_back(measured);
    }
    if (!plot.series.empty()) plots.push_back(plot);
  }
  return plots;
}

std::vector<Plot> RulePlots(const std::vector<Span>& spans) {
  std::vector<Plot> plots;
  for (const auto& [step_size, decrease] : kStepSizes) {
    Plot& plot = plots.emplace_back();
    plot.title = fmt::format("step size {}", step_size);
    plot.x_label = "predicted decrease";
    plot.y_label = "measured decrease";
    plot.x_range = plot.y_range = {kLowest, 1.0};
    for (const Span& span : spans) {
      plot.series.push_back(DecreasesOf(span, decrease));
    }
    Series& equal = plot.series.emplace_back();
    equal.title = "equal";
    equal.is_muted = true;
    equal.x = equal.y = {kLowest, 1.0};
  }
  return plots;
}

}  // namespace

bool WriteFreshResults(const std::string& folder,
                       const std::vector<int>& at,
                       const FreshResults& results,
                       std::string* error) {
  const std::vector<Span> spans = Spans(at, results.rule);
  const Table grid = GridTable(at, results.grid);
  const Table rule = RuleTable(spans);
  std::cout << "Grid, by steps of the step size that is best for fresh "
               "samples\n\n"
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
  DrawPictures({{folder + "fresh_samples.png", GridPlots(at, results.grid)},
                {folder + "calibration.png", RulePlots(spans)}});
  return true;
}

}  // namespace invgrad
