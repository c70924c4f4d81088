#include "bin/compare/point_report.h"

#include <string>
#include <utility>

#include "bin/support/html_output.h"
#include "fmt/core.h"
#include "invgrad/io/format.h"
#include "report/answer.h"

namespace invgrad {
namespace {

std::vector<std::pair<std::string, std::string>> Facts(
    const PointProblem& problem) {
  std::vector<std::pair<std::string, std::string>> facts = ProblemFacts();
  facts.emplace_back(
      "sizes",
      fmt::format(
          "|x| = {}, |y| = {}", problem.start.size(), problem.target.size()));
  if (problem.minimum.has_value()) {
    facts.emplace_back("minimum", FormatNumber(*problem.minimum));
  }
  return facts;
}

// A curve of a value that is not everywhere NaN.
Series PathCurve(const PointPath& path,
                 const std::vector<double>& x,
                 const std::vector<double>& y) {
  Series curve;
  for (size_t k = 0; k < path.x.size() && k < y.size(); ++k) {
    if (!x.empty() && k >= x.size()) break;
    curve.x.push_back(x.empty() ? static_cast<double>(k) : x[k]);
    curve.y.push_back(y[k]);
  }
  return curve;
}

HtmlReport::Chart Curves(const PointProblem& problem,
                         const std::vector<PointPath>& paths) {
  HtmlReport::Chart chart;
  chart.title = "Curves";
  const auto add_views = [&](const std::string& y_label,
                             std::vector<double> PointPath::*y) {
    const auto add = [&](const std::string& x_label,
                         std::vector<double> PointPath::*x,
                         bool log_x) {
      Plot view;
      view.x_label = x_label;
      view.y_label = y_label;
      view.log_x = log_x;
      view.log_y = true;
      for (size_t i = 0; i < paths.size(); ++i) {
        const std::vector<double> none;
        AddCurve(
            i,
            PathCurve(paths[i], x == nullptr ? none : paths[i].*x, paths[i].*y),
            paths[i].x.empty() ? 0.0 : (paths[i].*y)[0],
            &view);
      }
      chart.views.push_back(std::move(view));
    };
    add("step", nullptr, false);
    add("seconds", &PointPath::seconds, true);
    if (!problem.simulator->forms_jacobian()) {
      add("calls of the simulator", &PointPath::calls, true);
    }
  };
  add_views("L", &PointPath::loss);
  if (problem.minimizer.has_value()) {
    add_views("|x - x*|", &PointPath::distance);
  }
  return chart;
}

}  // namespace

HtmlReport PointReport(const PointProblem& problem,
                       const std::vector<Method>& methods,
                       const std::vector<PointPath>& paths,
                       const Table& table,
                       bool is_over) {
  const auto facts = Facts(problem);
  std::vector<std::string> labels;
  labels.reserve(methods.size());
  for (const Method& method : methods) labels.push_back(method.label);
  HtmlReport report = NewReport(
      facts[0].second,
      fmt::format("Which of {} methods finds the x with the lowest loss, from "
                  "the same start?",
                  methods.size()),
      labels,
      facts);
  if (!is_over) {
    report.progress = ProgressText(paths.size(), methods.size());
  }
  std::vector<Score> scores;
  for (size_t i = 0; i < paths.size(); ++i) {
    Score score;
    score.name = report.methods[i].name;
    score.median =
        paths[i].has_failed() ? HistoryRow::kNone : paths[i].loss.back();
    score.is_first_order = IsFirstOrder(methods[i]);
    scores.push_back(score);
    if (paths[i].has_failed()) {
      report.warnings.push_back(paths[i].label + ": " + paths[i].status);
    }
  }
  report.answer = AnswerByScores("loss", scores);
  report.charts.push_back(Curves(problem, paths));
  if (!paths.empty()) {
    report.sheets.push_back({"Methods",
                             "The best of a column is marked.",
                             table,
                             {"L", "|x - x*|", "mean |x - x*|", "calls", "s"},
                             {}});
  }
  return report;
}

}  // namespace invgrad
