#include "bin/compare/point_path.h"

#include "fmt/format.h"
#include "invgrad/io/atomic_file.h"

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
    default:
      return "steps done";
  }
}

}  // namespace

bool TracePath(const PointProblem& problem,
               const Method& method,
               const PointPathOptions& options,
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

bool WritePathCsv(const std::string& file,
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
  }
  for (size_t k = 0; k < path.x.size(); ++k) {
    std::vector<double> row = {path.loss[k]};
    if (is_printed) {
      row.insert(row.end(), path.x[k].begin(), path.x[k].end());
      row.insert(row.end(), path.y[k].begin(), path.y[k].end());
    } else {
      row.insert(row.end(),
                 {path.x[k].norm(), path.distance[k], path.seconds[k]});
    }
    csv += fmt::format("\n{},{:.17g}", k, fmt::join(row, ","));
  }
  return WriteFile(file, csv + '\n', error);
}

}  // namespace invgrad
