/*
Draws the paths of methods through a two-dimensional problem, over the
contours of its loss, in x space and in y space.

Sample runs:

  trajectories --steps=10 \
    --rules=gradient_descent:step_size=0.01,newton:step_size=0.3333
  trajectories --problem=squared_component:start_0=-2 \
    --rules=ceres_lm,ceres_bfgs,ceres_lm+half_inverse --output=runs/from_left
  trajectories --problem=sine_point --steps=40 --margin=0.8 --overwrite \
    --rules=gradient_descent:step_size=2e-3,physical_gradient:y_step_size=0.3
  trajectories --problem=linear_scale --steps=5 --output=runs/linear \
    --rules=gradient_descent:step_size=1e-4,half_inverse:step_size=1e-2

The directory holds trajectories.png (left x, right y), trajectories.gp to
restyle it, one CSV a rule, and the flags that repeat the run.
*/

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "bin/compare/point_comparison.h"
#include "bin/support/program.h"
#include "bin/support/results.h"
#include "bin/support/run_directory.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/minimize/chain_objective.h"
#include "problems/problems.h"
#include "report/plot.h"
#include "report/plot_axis.h"

DEFINE_string(problem,
              "squared_component",
              "a problem with two unknowns, name[:key=value...]");
DEFINE_string(rules,
              "gradient_descent:step_size=0.01,newton:step_size=0.3333333333,"
              "physical_gradient:y_step_size=0.3,half_inverse:step_size=0.1,"
              "ceres_lm,ceres_bfgs",
              "rules or minimizers of Ceres, name[:key=value...],...; "
              "`compare --list` shows all");
DEFINE_int32(steps, 10, "iterations of every rule");
DEFINE_int32(grid, 101, "points of the contours' grid along each axis");
DEFINE_double(margin,
              0.1,
              "margin on each side, as a share of the paths' extent");

namespace invgrad {
namespace {

// The points of all paths in x or in y, and the optimum's.
struct Panel {
  std::string name;  // "x" or "y"
  std::vector<std::vector<Eigen::VectorXd>> paths;
  Eigen::VectorXd goal;  // empty if there is none
};

// `loss` maps a point of the panel to L, NaN if L has no value.
Plot MakePlot(const Panel& panel,
              const std::vector<PointPath>& paths,
              const std::function<double(const Eigen::Vector2d&)>& loss) {
  Plot plot;
  plot.title = panel.name + " space";
  plot.x_label = panel.name + "_0";
  plot.y_label = panel.name + "_1";
  std::vector<double> xs, ys;  // of all points
  const auto add = [&](const std::string& title,
                       Series::Style style,
                       const std::vector<Eigen::VectorXd>& points) {
    Series series;
    series.title = title;
    series.style = style;
    for (const Eigen::VectorXd& point : points) {
      if (point.size() != 2) continue;
      series.x.push_back(point[0]);
      series.y.push_back(point[1]);
      if (!point.allFinite()) continue;
      xs.push_back(point[0]);
      ys.push_back(point[1]);
    }
    plot.series.push_back(series);
  };
  for (size_t i = 0; i < paths.size(); ++i) {
    add(paths[i].label, Series::Style::kLinesAndPoints, panel.paths[i]);
  }
  if (panel.goal.size() == 2) {
    add("optimum", Series::Style::kPoints, {panel.goal});
  }
  const Axis x_axis = FitAxis(false, {}, FLAGS_margin, {&xs});
  const Axis y_axis = FitAxis(false, {}, FLAGS_margin, {&ys});
  plot.x_range = {x_axis.low, x_axis.high};
  plot.y_range = {y_axis.low, y_axis.high};
  ContourField& field = plot.contours.emplace();
  field.z.resize(FLAGS_grid, FLAGS_grid);
  for (int i = 0; i < FLAGS_grid; ++i) {
    const double share = static_cast<double>(i) / (FLAGS_grid - 1);
    field.x.push_back(x_axis.low + (x_axis.high - x_axis.low) * share);
    field.y.push_back(y_axis.low + (y_axis.high - y_axis.low) * share);
  }
  for (int i = 0; i < FLAGS_grid; ++i) {
    for (int j = 0; j < FLAGS_grid; ++j) {
      field.z(i, j) = loss(Eigen::Vector2d(field.x[j], field.y[i]));
    }
  }
  return plot;
}

std::vector<Plot> MakePlots(const PointProblem& problem,
                            const std::vector<PointPath>& paths) {
  Panel x{"x", {}, {}}, y{"y", {}, {}};
  for (const PointPath& path : paths) {
    x.paths.push_back(path.x);
    y.paths.push_back(path.y);
  }
  ChainObjective objective = problem.MakeObjective();
  if (problem.minimizer.has_value()) {
    x.goal = *problem.minimizer;
    objective.SetState(x.goal);
    y.goal = objective.Outputs();
  }
  const double none = std::numeric_limits<double>::quiet_NaN();
  const auto loss_in_x = [&](const Eigen::Vector2d& point) {
    objective.SetState(point);
    double loss = none;
    std::string ignored;
    return objective.Cost(&loss, &ignored) ? loss : none;
  };
  const auto loss_in_y = [&](const Eigen::Vector2d& point) {
    double loss = none;
    return problem.loss->Evaluate(
               point.data(), problem.target.data(), &loss, nullptr, nullptr)
               ? loss
               : none;
  };
  return {MakePlot(x, paths, loss_in_x), MakePlot(y, paths, loss_in_y)};
}

void Print(const PointPath& path) {
  fmt::print("{}  ({})\n", path.label, path.status);
  fmt::print("  {:>4}  {:>14}  {:>14}  {:>14}  {:>14}  {:>12}\n",
             "step",
             "x_0",
             "x_1",
             "y_0",
             "y_1",
             "L");
  for (size_t k = 0; k < path.x.size(); ++k) {
    if (path.y[k].size() != 2) continue;
    fmt::print("  {:>4}  {:14.8g}  {:14.8g}  {:14.8g}  {:14.8g}  {:12.5g}\n",
               k,
               path.x[k][0],
               path.x[k][1],
               path.y[k][0],
               path.y[k][1],
               path.loss[k]);
  }
  if (path.x.size() > 1 && path.x[1] != path.x[0]) {
    const Eigen::VectorXd step = path.x[1] - path.x[0];
    fmt::print("  diagonal length of the first step: {:.6f}\n",
               -step.sum() / step.norm());
  }
}

bool Run(std::string* error) {
  PhysicsProblem problem;
  std::vector<Method> methods;
  if (!CheckFlags(
          {{"steps", {1.0}}, {"grid", {2.0, 1000.0}}, {"margin", {0.0, 100.0}}},
          error) ||
      !CreateProblem(FLAGS_problem, nullptr, &problem, error) ||
      !NameFlag("rules", ParseMethods(FLAGS_rules, &methods, error), error)) {
    return false;
  }
  if (!problem.point.has_value() || problem.point->start.size() != 2 ||
      problem.point->target.size() != 2) {
    *error = fmt::format(
        "--problem={} does not map two unknowns to two outputs; "
        "squared_component, linear_scale and sine_point do",
        FLAGS_problem);
    return false;
  }
  PointPathOptions options;
  options.max_num_iterations = FLAGS_steps;
  options.gradient_tolerance = 0.0;
  std::vector<PointPath> paths;
  for (const Method& method : methods) {
    if (!TracePath(
            *problem.point, method, options, &paths.emplace_back(), error)) {
      *error = method.label + ": " + *error;
      return false;
    }
  }
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, error)) return false;
  for (const PointPath& path : paths) {
    Print(path);
    if (!WritePathCsv(FLAGS_output + "/", path, error)) return false;
  }
  DrawPicture(FLAGS_output + "/trajectories.png",
              MakePlots(*problem.point, paths));
  fmt::print("results in {}\n", FLAGS_output);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "draws the paths of methods through a two-dimensional problem",
      invgrad::Run);
}
