#include "bin/compare/point_comparison.h"

#include <algorithm>
#include <utility>

#include "bin/support/results.h"
#include "bin/support/run_directory.h"
#include "fmt/format.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

// A method that could not run has no points.
Table PointTable(const PointProblem& problem,
                 const std::vector<PointPath>& paths) {
  const bool is_printed = problem.start.size() <= kMaxPrintedSize;
  const bool is_known = problem.minimizer.has_value();
  const auto of_path = [](auto cell) {
    return [cell](const PointPath& path) {
      return path.x.empty() ? std::string("-") : cell(path);
    };
  };
  const auto number = [&of_path](auto value) {
    return of_path(
        [value](const PointPath& path) { return NumberOrDash(value(path)); });
  };
  std::vector<ColumnOf<PointPath>> columns = {
      {"method",
       [](const PointPath& path) { return path.label; },
       Table::Align::kLeft},
      {"steps", of_path([](const PointPath& path) {
         return std::to_string(path.x.size() - 1);
       })},
      {"L at start", of_path([](const PointPath& p) {
         return FormatNumber(p.loss.front());
       })},
      {"L",
       of_path([](const PointPath& p) { return FormatNumber(p.loss.back()); })},
      {is_printed ? "x" : "|x|", of_path([is_printed](const PointPath& path) {
         const Eigen::VectorXd& x = path.x.back();
         return is_printed ? fmt::format("({:.6g})",
                                         fmt::join(x.begin(), x.end(), ", "))
                           : FormatNumber(x.norm());
       })},
      {"|x - x*|",
       number([](const PointPath& path) { return path.distance.back(); })}};
  if (!is_printed) {
    columns.push_back(
        {"mean |x - x*|", of_path([&](const PointPath& path) {
           return is_known ? FormatNumber((path.x.back() - *problem.minimizer)
                                              .cwiseAbs()
                                              .mean())
                           : "-";
         })});
  }
  columns.push_back({"s", of_path([](const PointPath& path) {
                       return FormatNumber(path.summary.total_time_in_seconds);
                     })});
  columns.push_back({"status",
                     [](const PointPath& path) { return path.status; },
                     Table::Align::kLeft});
  return MakeTable(columns, paths);
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
  map.z_range = {reference.minCoeff(), reference.maxCoeff()};
  return plot;
}

// What is left of the runs, where x is too large to be printed.
bool WriteFinalStates(const PointProblem& problem,
                      const std::vector<PointPath>& paths,
                      const std::string& directory,
                      std::string* error) {
  std::vector<std::pair<std::string, Eigen::VectorXd>> states;
  if (problem.minimizer.has_value()) {
    if (!WriteNpy(directory + "/x-true.npy", *problem.minimizer, error)) {
      return false;
    }
    states.emplace_back("x*", *problem.minimizer);
  }
  for (const PointPath& path : paths) {
    if (path.x.empty()) continue;
    states.emplace_back(path.label, path.x.back());
    if (!WriteNpy(fmt::format("{}/x-{}.npy", directory, FileName(path.label)),
                  path.x.back(),
                  error)) {
      return false;
    }
  }
  std::vector<Plot> panels;
  for (const auto& [title, x] : states) {
    if (problem.field_rows == 0) break;
    panels.push_back(
        FieldPlot(title, x, problem.field_rows, states.front().second));
  }
  DrawPicture(directory + "/fields.png", panels);
  return true;
}

}  // namespace

bool ComparePoint(const PointProblem& problem,
                  const std::vector<Method>& methods,
                  const PointPathOptions& options,
                  const std::string& directory,
                  std::ostream& out,
                  std::string* error) {
  std::vector<PointPath> paths;
  std::vector<Plot> plots(1);
  plots[0].title = "loss";
  plots[0].x_label = "step";
  plots[0].y_label = "L";
  plots[0].log_y = true;
  for (const Method& method : methods) {
    PointPath path;
    std::string why;
    if (TracePath(problem, method, options, &path, &why)) {
      const std::string name = FileName(method.label);
      if (!WritePathCsv(
              fmt::format("{}/path-{}.csv", directory, name), path, error)) {
        return false;
      }
      Series series;
      series.title = method.label;
      series.y = path.loss;
      for (size_t k = 0; k < path.loss.size(); ++k) {
        series.x.push_back(static_cast<double>(k));
      }
      plots[0].series.push_back(series);
    } else {
      path.x.clear();
      path.status = why;
    }
    paths.push_back(std::move(path));
  }
  const Table table = PointTable(problem, paths);
  out << table.ToText();
  if (!WriteTable(directory + "/table", table, error) ||
      (problem.start.size() > kMaxPrintedSize &&
       !WriteFinalStates(problem, paths, directory, error))) {
    return false;
  }
  MuteAllButTheLowest(&plots);
  DrawPicture(directory + "/loss.png", plots);
  out << "results in " << directory << "\n";
  *error = "no method could run";
  return std::any_of(paths.begin(), paths.end(), [](const PointPath& path) {
    return !path.x.empty();
  });
}

}  // namespace invgrad
