#include "bin/support/point_comparison.h"

#include <cmath>
#include <limits>
#include <sstream>

#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "invgrad/minimize/chain_objective.h"
#include "report/plot.h"
#include "report/table.h"

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

bool IsPrinted(const Eigen::VectorXd& x) { return x.size() <= kMaxPrintedSize; }

std::vector<Table::Column> TableColumns(const PointProblem& problem) {
  std::vector<Table::Column> columns = {
      {"method", Table::Align::kLeft},
      {"steps"},
      {"L at start"},
      {"L"},
      {IsPrinted(problem.start) ? "x" : "|x|"},
      {"|x - x*|"}};
  if (!IsPrinted(problem.start)) columns.push_back({"mean |x - x*|"});
  columns.push_back({"s"});
  columns.push_back({"status", Table::Align::kLeft});
  return columns;
}

std::vector<std::string> TableRow(const PointProblem& problem,
                                  const PointPath& path) {
  const Eigen::VectorXd& x = path.x.back();
  const bool is_known = problem.minimizer.has_value();
  std::vector<std::string> row = {
      path.label,
      std::to_string(path.x.size() - 1),
      FormatNumber(path.loss.front()),
      FormatNumber(path.loss.back()),
      IsPrinted(x) ? PointText(x) : FormatNumber(x.norm()),
      is_known ? FormatNumber(path.distance.back()) : "-"};
  if (!IsPrinted(x)) {
    row.push_back(is_known
                      ? FormatNumber((x - *problem.minimizer).cwiseAbs().mean())
                      : "-");
  }
  row.push_back(FormatNumber(path.summary.total_time_in_seconds));
  row.push_back(path.status);
  return row;
}

// A row for a method that cannot take the problem.
std::vector<std::string> RefusalRow(const std::string& label,
                                    const std::string& why,
                                    size_t num_columns) {
  std::vector<std::string> row(num_columns, "-");
  row.front() = label;
  row.back() = why;
  return row;
}

// The colours of all panels are those of `reference`.
Plot FieldPlot(const std::string& title,
               const Eigen::VectorXd& x,
               int num_rows,
               const Eigen::VectorXd& reference) {
  Plot plot;
  plot.title = title;
  plot.equal_aspect = true;
  HeatMap& map = plot.heat_map.emplace();
  map.z = x.reshaped<Eigen::RowMajor>(num_rows, x.size() / num_rows);
  for (Eigen::Index i = 0; i < map.z.rows(); ++i) {
    map.y.push_back(static_cast<double>(i));
  }
  for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
    map.x.push_back(static_cast<double>(j));
  }
  map.z_range = {reference.minCoeff(), reference.maxCoeff()};
  return plot;
}

// What is left of the runs, where x is too large to be printed.
bool WriteFinalStates(const PointProblem& problem,
                      const std::vector<std::string>& labels,
                      const std::vector<Eigen::VectorXd>& states,
                      const PointComparisonOptions& options,
                      std::string* error) {
  if (problem.minimizer.has_value() &&
      !WriteNpy(options.output + "/x-true.npy", *problem.minimizer, error)) {
    return false;
  }
  for (size_t i = 0; i < states.size(); ++i) {
    const std::string file =
        options.output + "/x-" + FileName(labels[i]) + ".npy";
    if (!WriteNpy(file, states[i], error)) return false;
  }
  if (!options.plots || problem.field_rows == 0 || states.empty()) return true;
  const Eigen::VectorXd& reference =
      problem.minimizer.has_value() ? *problem.minimizer : states.front();
  std::vector<Plot> panels;
  if (problem.minimizer.has_value()) {
    panels.push_back(FieldPlot("x*", reference, problem.field_rows, reference));
  }
  for (size_t i = 0; i < states.size(); ++i) {
    panels.push_back(
        FieldPlot(labels[i], states[i], problem.field_rows, reference));
  }
  std::string plot_error;
  if (!WritePlots(options.output + "/fields.png", panels, &plot_error)) {
    Warn(plot_error);
  }
  return true;
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
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<ceres::IterationSummary>& iterations =
      path->summary.iterations;
  // A failed step is not in the path: the last point is the last good one.
  for (size_t k = 0; k < path->x.size(); ++k) {
    const Eigen::VectorXd& x = path->x[k];
    objective.SetState(x);
    path->y.push_back(objective.Outputs());
    double loss = 0.0;
    std::string ignored;
    path->loss.push_back(objective.Cost(&loss, &ignored) ? loss : nan);
    path->distance.push_back(
        problem.minimizer.has_value() ? (x - *problem.minimizer).norm() : nan);
    path->seconds.push_back(
        k < iterations.size() ? iterations[k].cumulative_time_in_seconds : nan);
  }
  path->status = Status(path->summary);
  return true;
}

bool WritePathCsv(const std::string& file,
                  const PointPath& path,
                  std::string* error) {
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  if (!IsPrinted(path.x[0])) {
    csv << "iteration,loss,x_norm,distance,seconds\n";
    for (size_t k = 0; k < path.x.size(); ++k) {
      csv << k << ',' << path.loss[k] << ',' << path.x[k].norm() << ','
          << path.distance[k] << ',' << path.seconds[k] << '\n';
    }
    return WriteFile(file, csv.str(), error);
  }
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
  const std::vector<Table::Column> columns = TableColumns(problem);
  Table table(columns);
  std::vector<std::string> labels;
  std::vector<Eigen::VectorXd> final_states;
  Plot plot;
  plot.title = "loss";
  plot.x_label = "step";
  plot.y_label = "L";
  plot.log_y = true;
  for (const Method& method : methods) {
    PointPath path;
    std::string why;
    if (!TracePath(problem, method, options, &path, &why)) {
      table.AddRow(RefusalRow(method.label, why, columns.size()));
      continue;
    }
    table.AddRow(TableRow(problem, path));
    const std::string file =
        options.output + "/path-" + FileName(method.label) + ".csv";
    if (!WritePathCsv(file, path, error)) return false;
    labels.push_back(path.label);
    final_states.push_back(path.x.back());
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
  if (!IsPrinted(problem.start) &&
      !WriteFinalStates(problem, labels, final_states, options, error)) {
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
