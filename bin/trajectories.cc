/*
Draws the paths of methods through a two-dimensional problem, over a map of its
loss, in x space and in y space.

Sample runs:

  trajectories --steps=10 \
    --rules=gradient_descent:step_size=0.01,newton:step_size=0.3333
  trajectories --problem=squared_component:start_0=-2 \
    --rules=ceres_lm,ceres_bfgs,ceres_lm+half_inverse --output=runs/from_left
  trajectories --problem=sine_point --steps=40 --margin=0.8 --overwrite \
    --rules=gradient_descent:step_size=2e-3,physical_gradient:y_step_size=0.3
  trajectories --problem=linear_scale --steps=5 --output=runs/linear \
    --rules=gradient_descent:step_size=1e-4,half_inverse:step_size=1e-2

The directory holds trajectories.png (left x, right y), trajectories.gp and
trajectories.csv to restyle it, and one CSV a rule.
*/

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/output_options.h"
#include "bin/support/point_path.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "problems/problems.h"
#include "report/interrupt.h"
#include "report/plot.h"

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
DEFINE_int32(grid, 101, "cells of the map of the loss along each axis");
DEFINE_double(margin,
              0.1,
              "margin on each side, as a share of the paths' extent");

namespace invgrad {
namespace {

using Points = std::vector<Eigen::VectorXd>;

// Centers of FLAGS_grid cells along an axis, which reach over the values and a
// margin.
Eigen::VectorXd Grid(const std::vector<double>& values) {
  const AxisRange range = RangeOf(values, false);
  const double extent = *range.high - *range.low;
  const double margin = extent > 0.0 ? FLAGS_margin * extent : 0.5;
  return Eigen::VectorXd::LinSpaced(
      FLAGS_grid, *range.low - margin, *range.high + margin);
}

// A panel with the points of all paths in x or in y, as `name` says. `goal` is
// empty if there is none. `loss` maps a point of the panel to L, NaN if L has
// no value.
Plot MakePlot(const std::string& name,
              const std::vector<PointPath>& paths,
              Points PointPath::*points,
              const Points& goal,
              const std::function<double(const Eigen::Vector2d&)>& loss) {
  Plot plot;
  plot.title = name + " space";
  plot.x_label = name + "_0";
  plot.y_label = name + "_1";
  std::vector<double> xs, ys;  // of all points
  const auto add =
      [&](const std::string& title, Series::Style style, const Points& path) {
        Series series;
        series.title = title;
        series.style = style;
        for (const Eigen::VectorXd& point : path) {
          if (point.size() != 2) continue;
          series.x.push_back(point[0]);
          series.y.push_back(point[1]);
          if (!point.allFinite()) continue;
          xs.push_back(point[0]);
          ys.push_back(point[1]);
        }
        plot.series.push_back(series);
      };
  std::vector<std::string> labels;
  labels.reserve(paths.size());
  for (const PointPath& path : paths) labels.push_back(path.label);
  const std::vector<std::string> names = ShortNames(labels);
  for (size_t i = 0; i < paths.size(); ++i) {
    add(names[i], Series::Style::kLinesAndPoints, paths[i].*points);
  }
  if (!goal.empty()) add("optimum", Series::Style::kPoints, goal);
  const Eigen::VectorXd at_x = Grid(xs), at_y = Grid(ys);
  plot.x_range = {at_x[0], at_x[FLAGS_grid - 1]};
  plot.y_range = {at_y[0], at_y[FLAGS_grid - 1]};
  HeatMap& map = plot.heat_map.emplace();
  map.is_grey = true;
  map.z_label = "L";
  map.x_first = at_x[0];
  map.x_step = at_x[1] - at_x[0];
  map.y_first = at_y[0];
  map.y_step = at_y[1] - at_y[0];
  map.z = Eigen::MatrixXd::NullaryExpr(
      FLAGS_grid, FLAGS_grid, [&](Eigen::Index i, Eigen::Index j) {
        return loss(Eigen::Vector2d(at_x[j], at_y[i]));
      });
  map.log_z = !(map.z.array() <= 0.0).any();
  return plot;
}

std::vector<Plot> MakePlots(const PointProblem& problem,
                            const std::vector<PointPath>& paths) {
  PointObjective objective = problem.MakeObjective();
  Points x_goal, y_goal;
  if (problem.minimizer.has_value()) {
    x_goal = {*problem.minimizer};
    objective.SetState(*problem.minimizer);
    y_goal = {objective.Outputs()};
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
  return {MakePlot("x", paths, &PointPath::x, x_goal, loss_in_x),
          MakePlot("y", paths, &PointPath::y, y_goal, loss_in_y)};
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

bool Run(RunCounts* counts, std::string* error) {
  PhysicsProblem problem;
  std::vector<Method> methods;
  if (!CheckFlags(
          {{"steps", {1.0}}, {"grid", {2.0, 1000.0}}, {"margin", {0.0, 100.0}}},
          error) ||
      !NameFlag("problem",
                CreateProblem(FLAGS_problem, nullptr, &problem, error),
                error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
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
  MinimizerOptions options;
  options.max_num_iterations = FLAGS_steps;
  options.gradient_tolerance = 0.0;  // every run takes all steps
  if (!PathsFitInMemory(*problem.point, FLAGS_steps, methods.size(), error)) {
    return false;
  }
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, error)) return false;
  const Interrupt interrupt;
  std::vector<PointPath> paths;
  for (const Method& method : methods) {
    if (Interrupt::IsRequested()) break;
    PointPath path;
    std::string why;
    const bool has_run =
        TracePath(*problem.point, method, options, &path, &why);
    counts->Add(has_run && !path.has_failed());
    if (!has_run) {
      fmt::print("{}  (not run: {})\n", method.label, why);
      continue;
    }
    Print(path);
    if (!WritePathCsv(InOutput(""), path, error)) return false;
    paths.push_back(std::move(path));
  }
  fmt::print("results in {}\n", Output().output);
  if (paths.empty()) return true;
  DrawPictures(
      {{InOutput("trajectories.png"), MakePlots(*problem.point, paths)}});
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  invgrad::AddOutputFlags();
  invgrad::RegisterProblems();
  return invgrad::RunProgram(
      argc,
      argv,
      "draws the paths of methods through a two-dimensional problem",
      invgrad::Run);
}
