#include "bin/estimate/estimation_report.h"

#include <algorithm>
#include <utility>

#include "bin/support/html_output.h"
#include "fmt/ranges.h"
#include "report/answer.h"
#include "report/html_profiles.h"

namespace invgrad {
namespace {

// How each way went from each start, against the work of plots[k].
ProfileWork WorkOf(const std::string& name,
                   size_t k,
                   size_t num_ways,
                   const std::vector<StartCosts>& costs) {
  ProfileWork work{name, {}};
  for (const StartCosts& start : costs) {
    std::vector<SolveTrace>& solvers = work.traces.emplace_back(num_ways);
    for (const Series& series : start.plots[k].series) {
      solvers[series.color] = {series.x, series.y};
    }
  }
  return work;
}

HtmlReport::Chart CostChart(const std::vector<StartCosts>& costs) {
  constexpr size_t kMaxStarts = 60;
  HtmlReport::Chart chart;
  chart.title = "Costs";
  for (size_t i = 0; i < std::min(costs.size(), kMaxStarts); ++i) {
    for (const Plot& plot : costs[i].plots) {
      if (plot.series.empty()) continue;
      chart.views.push_back(plot);
      chart.views.back().title = costs[i].start;
      chart.views.back().log_x = true;
    }
  }
  chart.caption =
      costs.size() > kMaxStarts
          ? fmt::format(
                "From the first {} of {} starts; a rejected step keeps "
                "the cost.",
                kMaxStarts,
                costs.size())
          : "From each start; a rejected step keeps the cost.";
  return chart;
}

std::vector<std::pair<std::string, std::string>> Facts(
    const EstimationOptions& options,
    const std::vector<EstimationInput>& inputs) {
  constexpr size_t kMaxShown = 5;
  std::vector<std::pair<std::string, std::string>> facts;
  for (size_t i = 0; i < std::min(inputs.size(), kMaxShown); ++i) {
    facts.emplace_back(inputs[i].name,
                       inputs[i].estimation->traits().description);
  }
  if (inputs.size() > kMaxShown) {
    facts.emplace_back(
        "and", fmt::format("{} more inputs", inputs.size() - kMaxShown));
  }
  const MinimizerOptions& budget = inputs[0].estimation->traits().budget;
  facts.emplace_back(
      "budget",
      fmt::format("{} iterations{}",
                  options.max_iterations > 0 ? options.max_iterations
                                             : budget.max_num_iterations,
                  options.seconds > 0.0
                      ? fmt::format(", or {:g} s", options.seconds)
                      : ""));
  const std::vector<int>& drawn = inputs[0].estimation->traits().seeds;
  facts.emplace_back(
      "starts",
      options.perturb > 0.0 ? fmt::format("perturbed by {:g}, seeds {}",
                                          options.perturb,
                                          fmt::join(options.seeds, ", "))
      : drawn.empty()       ? "as given"
                            : fmt::format("seeds {}", fmt::join(drawn, ", ")));
  return facts;
}

}  // namespace

HtmlReport EstimationReport(const EstimationOptions& options,
                            const std::vector<EstimationInput>& inputs,
                            const std::vector<Way>& ways,
                            const std::vector<EstimationRow>& rows,
                            const std::vector<StartCosts>& costs,
                            bool is_over) {
  std::vector<std::string> labels;
  labels.reserve(ways.size());
  for (const Way& way : ways) labels.push_back(way.label);
  HtmlReport report = NewReport(
      inputs.size() == 1 ? inputs[0].name
                         : fmt::format("{} inputs", inputs.size()),
      fmt::format("Which of {} methods finds the parameters with the least "
                  "cost, and from how many starts?",
                  ways.size()),
      labels,
      Facts(options, inputs));
  if (!is_over) {
    report.progress = fmt::format(
        "{} starts are done; this page reads itself "
        "again every 10 s.",
        costs.size());
  }
  if (rows.empty()) return report;
  std::vector<std::pair<std::string, int>> least = LeastCostCounts(rows);
  for (auto& [name, count] : least) {
    const auto at = std::find(labels.begin(), labels.end(), name);
    name = report.methods[at - labels.begin()].name;
  }
  report.answer = AnswerByCounts("reaches the least cost of all methods",
                                 "from",
                                 costs.size() == 1 ? "start" : "starts",
                                 least,
                                 static_cast<int>(costs.size()));
  for (const EstimationRow& row : rows) {
    if (row.has_failed) {
      report.warnings.push_back(
          fmt::format("{}, {}: {}", row.start, row.method, row.status));
    }
  }
  report.charts.push_back(
      ProfileChart("starts",
                   {WorkOf("seconds", 1, ways.size(), costs),
                    WorkOf("iterations", 0, ways.size(), costs)}));
  report.charts.push_back(CostChart(costs));
  report.sheets.push_back({"Methods",
                           "Over all starts. The best of a column is marked.",
                           EstimationSummary(rows),
                           {"iterations", "rejected", "s"},
                           {"least cost", "solved", "digits", "mean digits"}});
  const Table minima = LocalMinimaTable(rows);
  if (minima.rows().size() > 1) {
    report.sheets.push_back({"Where the runs ended",
                             "Costs that agree to 1e-4 are one minimum. How "
                             "many starts of each method ended there.",
                             minima,
                             {},
                             {}});
  }
  constexpr size_t kMaxOpenRows = 20;
  report.sheets.push_back(
      {"All runs",
       "",
       EstimationTable(rows, options.levels, /*is_exact=*/false),
       {},
       {},
       rows.size() > kMaxOpenRows});
  return report;
}

}  // namespace invgrad
