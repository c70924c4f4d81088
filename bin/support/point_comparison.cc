#include "bin/support/point_comparison.h"

#include <cmath>
#include <limits>
#include <sstream>

#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/plot.h"
#include "invgrad/io/progress.h"
#include "invgrad/io/table.h"

namespace invgrad {

namespace {

std::string Status(const MinimizerSummary& summary) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return "converged";
    case ceres::FAILURE:
    case ceres::USER_FAILURE:
      return "failed: " + summary.message;
    default:
      return "steps done";
  }
}

void PrintVector(const Eigen::VectorXd& vector, std::ostream& out) {
  for (const double value : vector) out << ',' << value;
}

std::string PointText(const Eigen::VectorXd& x) {
  std::ostringstream text;
  text.precision(6);
  text << '(';
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    text << (i > 0 ? ", " : "") << x[i];
  }
  text << ')';
  return text.str();
}

std::vector<std::string> TableRow(const PointProblem& problem,
                                  const PointPath& path) {
  const Eigen::VectorXd& x = path.x.back();
  const std::string distance =
      problem.minimizer.has_value()
          ? FormatNumber((x - *problem.minimizer).norm())
          : "-";
  return {path.label,
          std::to_string(path.x.size() - 1),
          FormatNumber(path.loss.front()),
          FormatNumber(path.loss.back()),
          PointText(x),
          distance,
          path.status};
}

}  // namespace

bool TracePath(const PointProblem& problem,
               const Method& method,
               const PointComparisonOptions& options,
               PointPath* path,
               std::string* error) {
  *path = PointPath();
  path->label = method.label;
  MinimizerOptions minimizer;
  minimizer.max_num_iterations = options.max_num_iterations;
  minimizer.max_time_in_seconds = options.max_time_in_seconds;
  minimizer.gradient_tolerance = options.gradient_tolerance;
  minimizer.function_tolerance = 0.0;
  minimizer.parameter_tolerance = 0.0;
  ChainObjective objective = problem.MakeObjective();
  if (!MinimizeByMethod(method,
                        minimizer,
                        problem.inverse,
                        &objective,
                        &path->x,
                        &path->summary,
                        error)) {
    return false;
  }
  // A failed step is not in the path: the last point is the last good one.
  for (const Eigen::VectorXd& x : path->x) {
    objective.SetState(x);
    path->y.push_back(objective.Outputs());
    double loss = 0.0;
    std::string ignored;
    path->loss.push_back(objective.Cost(&loss, &ignored)
                             ? loss
                             : std::numeric_limits<double>::quiet_NaN());
  }
  path->status = Status(path->summary);
  return true;
}

bool WritePathCsv(const std::string& file,
                  const PointPath& path,
                  std::string* error) {
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  csv << "iteration,loss";
  for (Eigen::Index i = 0; i < path.x[0].size(); ++i) csv << ",x" << i;
  for (Eigen::Index i = 0; i < path.y[0].size(); ++i) csv << ",y" << i;
  csv << '\n';
  for (size_t k = 0; k < path.x.size(); ++k) {
    csv << k << ',' << path.loss[k];
    PrintVector(path.x[k], csv);
    PrintVector(path.y[k], csv);
    csv << '\n';
  }
  return WriteFile(file, csv.str(), error);
}

bool ComparePoint(const PointProblem& problem,
                  const std::vector<Method>& methods,
                  const PointComparisonOptions& options,
                  std::ostream& out,
                  std::string* error) {
  Table table({{"method", Table::Align::kLeft},
               {"steps"},
               {"L at start"},
               {"L"},
               {"x"},
               {"|x - x*|"},
               {"status", Table::Align::kLeft}});
  Plot plot;
  plot.title = "loss";
  plot.x_label = "step";
  plot.y_label = "L";
  plot.log_y = true;
  for (const Method& method : methods) {
    PointPath path;
    std::string why;
    if (!TracePath(problem, method, options, &path, &why)) {
      table.AddRow({method.label, "-", "-", "-", "-", "-", why});
      continue;
    }
    table.AddRow(TableRow(problem, path));
    const std::string file =
        options.output + "/path-" + FileName(method.label) + ".csv";
    if (!WritePathCsv(file, path, error)) return false;
    Series series;
    series.title = method.label;
    for (size_t k = 0; k < path.loss.size(); ++k) {
      series.x.push_back(static_cast<double>(k));
      series.y.push_back(path.loss[k]);
    }
    plot.series.push_back(series);
  }
  out << table.ToText();
  if (!WriteFile(options.output + "/table.txt", table.ToText(), error) ||
      !WriteFile(options.output + "/table.md", table.ToMarkdown(), error)) {
    return false;
  }
  std::string plot_error;
  if (options.plots &&
      !WritePlot(options.output + "/loss.png", plot, &plot_error)) {
    Warn(plot_error);
  }
  out << "results in " << options.output << "\n";
  return true;
}

}  // namespace invgrad
