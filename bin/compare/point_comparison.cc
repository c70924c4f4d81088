#include "bin/compare/point_comparison.h"

#include <algorithm>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "bin/compare/counted_simulator.h"
#include "bin/compare/field_plots.h"
#include "bin/support/live_run.h"
#include "bin/support/run_output.h"
#include "fmt/ranges.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string Status(const MinimizerSummary& summary) {
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      return "converged";
    case ceres::FAILURE:
    case ceres::USER_FAILURE:
      return "failed: " + summary.message;
    case ceres::USER_SUCCESS:
      return "interrupted";
    default:
      return "steps done";
  }
}

// A method that could not run has no points.
Table PointTable(const PointProblem& problem,
                 const std::vector<PointPath>& paths) {
  const bool is_printed = problem.start.size() <= kMaxPrintedSize;
  Table table;
  for (const PointPath& path : paths) {
    const bool has_run = !path.x.empty();
    const auto add = [&](const std::string& title, const std::string& cell) {
      table.Add(title, has_run ? cell : "-");
    };
    const Eigen::VectorXd& x = has_run ? path.x.back() : problem.start;
    table.BeginRow();
    table.Add("method", path.label, Table::Align::kLeft);
    add("steps", std::to_string(path.x.size() - 1));
    add("L at start", FormatNumber(has_run ? path.loss.front() : kNan));
    add("L", FormatNumber(has_run ? path.loss.back() : kNan));
    if (is_printed) {
      add("x", fmt::format("({:.6g})", fmt::join(x.begin(), x.end(), ", ")));
    } else {
      add("|x|", FormatNumber(x.norm()));
    }
    const Eigen::VectorXd error =
        problem.minimizer.has_value()
            ? Eigen::VectorXd(x - *problem.minimizer)
            : Eigen::VectorXd::Constant(x.size(), kNan);
    add("|x - x*|", NumberOrDash(error.norm()));
    if (!is_printed) {
      add("mean |x - x*|", NumberOrDash(error.cwiseAbs().mean()));
    }
    if (!problem.simulator->forms_jacobian()) {
      add("calls", FormatNumber(has_run ? path.calls.back() : kNan));
    }
    add("s", FormatNumber(path.summary.total_time_in_seconds));
    table.Add("status", path.status, Table::Align::kLeft);
  }
  return table;
}

// Records the calls before each step.
class CallRecorder final : public ceres::IterationCallback {
 public:
  CallRecorder(const CountedSimulator* simulator, std::vector<double>* calls)
      : simulator_(simulator), calls_(calls) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& /*iteration*/) override {
    calls_->push_back(static_cast<double>(simulator_->num_calls()));
    return ceres::SOLVER_CONTINUE;
  }

 private:
  const CountedSimulator* simulator_;
  std::vector<double>* calls_;
};

// The results of the runs if x is too large to print; fields for `panels`.
bool WriteFinalStates(const PointProblem& problem,
                      const std::vector<PointPath>& paths,
                      std::vector<Plot>* panels,
                      std::string* error) {
  Eigen::VectorXd colours_of;
  const auto add = [&](const std::string& title,
                       const std::string& file,
                       const Eigen::VectorXd& x) {
    if (problem.field_rows > 0) {
      // All panels have the colours of the first.
      if (panels->empty()) colours_of = x;
      panels->push_back(FieldPlot(title, problem.field_rows, x, colours_of));
    }
    const std::string path = fmt::format("{}/x-{}.npy", FLAGS_output, file);
    return ListRunFile(path, error) && WriteNpy(path, x, error);
  };
  if (problem.minimizer.has_value() && !add("x*", "true", *problem.minimizer)) {
    return false;
  }
  for (const PointPath& path : paths) {
    if (!path.x.empty() &&
        !add(path.label, FileName(path.label), path.x.back())) {
      return false;
    }
  }
  return true;
}

}  // namespace

bool PathsFitInMemory(const PointProblem& problem,
                      double num_steps,
                      size_t num_methods,
                      std::string* error) {
  // x and y, each with what its vector needs; loss, distance, time and curve.
  const double numbers =
      static_cast<double>(problem.start.size() + problem.target.size()) + 17.0;
  const double bytes =
      sizeof(ceres::IterationSummary) + sizeof(double) * numbers;
  return FitsInMemory(
      fmt::format("--steps={:.0f}", num_steps),
      {{"the paths", bytes * num_steps * static_cast<double>(num_methods)}},
      /*limit=*/0.0,
      error);
}

bool TracePath(const PointProblem& problem,
               const Method& method,
               MinimizerOptions options,
               PointPath* path,
               std::string* error) {
  *path = PointPath();
  path->label = method.label;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  LiveCallback live(method.label);
  options.callbacks.push_back(&live);
  PointProblem counted = problem;
  std::optional<CallRecorder> recorder;
  if (!problem.simulator->forms_jacobian()) {
    const auto simulator =
        std::make_shared<CountedSimulator>(problem.simulator);
    counted.simulator = simulator;
    options.callbacks.push_back(
        &recorder.emplace(simulator.get(), &path->calls));
  }
  ChainObjective objective = counted.MakeObjective();
  if (!MinimizeByMethod(method,
                        options,
                        problem.inverse,
                        &objective,
                        &path->x,
                        &path->summary,
                        error)) {
    return false;
  }
  // An iteration that failed has no point.
  if (recorder.has_value()) path->calls.resize(path->x.size(), kNan);
  const auto& iterations = path->summary.iterations;
  // A failed step is not in the path: the last point is the last good one.
  for (size_t k = 0; k < path->x.size(); ++k) {
    const Eigen::VectorXd& x = path->x[k];
    objective.SetState(x);
    path->y.push_back(objective.Outputs());
    double loss = 0.0;
    std::string ignored;
    path->loss.push_back(objective.Cost(&loss, &ignored) ? loss : kNan);
    path->distance.push_back(
        problem.minimizer.has_value() ? (x - *problem.minimizer).norm() : kNan);
    path->seconds.push_back(k < iterations.size()
                                ? iterations[k].cumulative_time_in_seconds
                                : kNan);
  }
  path->status = Status(path->summary);
  return true;
}

bool WritePathCsv(const std::string& prefix,
                  const PointPath& path,
                  std::string* error) {
  const bool is_printed = path.x[0].size() <= kMaxPrintedSize;
  std::string csv = "iteration,loss";
  if (is_printed) {
    for (Eigen::Index i = 0; i < path.x[0].size(); ++i) {
      csv += fmt::format(",x{}", i);
    }
    for (Eigen::Index i = 0; i < path.y[0].size(); ++i) {
      csv += fmt::format(",y{}", i);
    }
  } else {
    csv += ",x_norm,distance,seconds";
    if (!path.calls.empty()) csv += ",calls";
  }
  for (size_t k = 0; k < path.x.size(); ++k) {
    std::vector<double> row = {path.loss[k]};
    if (is_printed) {
      row.insert(row.end(), path.x[k].begin(), path.x[k].end());
      row.insert(row.end(), path.y[k].begin(), path.y[k].end());
    } else {
      row.insert(row.end(),
                 {path.x[k].norm(), path.distance[k], path.seconds[k]});
      if (!path.calls.empty()) row.push_back(path.calls[k]);
    }
    csv += fmt::format("\n{},{:.17g}", k, fmt::join(row, ","));
  }
  return WriteRunFile(
      prefix + FileName(path.label) + ".csv", csv + '\n', error);
}

bool ComparePoint(const PointProblem& problem,
                  const std::vector<Method>& methods,
                  const MinimizerOptions& options,
                  RunCounts* counts,
                  std::string* error) {
  const Interrupt interrupt;
  std::vector<PointPath> paths;
  std::vector<Plot> fields;
  std::vector<Plot> plots(1);
  plots[0].title = "loss";
  plots[0].x_label = "step";
  plots[0].y_label = "L";
  plots[0].log_y = true;
  for (const Method& method : methods) {
    PointPath path;
    path.label = method.label;
    std::string why = "not run: interrupted";
    if (!Interrupt::IsRequested() &&
        TracePath(problem, method, options, &path, &why)) {
      if (!WritePathCsv(FLAGS_output + "/path-", path, error)) return false;
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
    counts->Add(!path.has_failed());
    paths.push_back(std::move(path));
  }
  const Table table = PointTable(problem, paths);
  std::cout << table.ToText();
  if (!WriteTable(FLAGS_output + "/table", table, error) ||
      (problem.start.size() > kMaxPrintedSize &&
       !WriteFinalStates(problem, paths, &fields, error))) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  MuteAllButTheLowest(&plots);
  DrawPictures({{FLAGS_output + "/fields.png", fields},
                {FLAGS_output + "/loss.png", plots}});
  return true;
}

}  // namespace invgrad
