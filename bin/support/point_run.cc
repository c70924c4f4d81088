#include "bin/support/point_run.h"

#include <cmath>

#include "bin/support/minimization_record.h"
#include "bin/support/run_directory.h"
#include "bin/support/run_output.h"
#include "invgrad/io/digest.h"
#include "report/table.h"

namespace invgrad {
namespace {

// The simulator is identified by its value at the start.
RunIdentity IdentityOf(const PointProblem& problem, const Method& method) {
  const PointObjective objective = problem.MakeObjective();
  double loss = 0.0;
  std::string why;
  const bool has_loss = objective.Cost(&loss, &why);
  RunIdentity identity;
  identity.Add("method", method.label);
  identity.Add("start and target",
               Digest().Add(problem.start).Add(problem.target).Hex());
  identity.Add("simulator", Digest().Add(objective.Outputs()).Hex());
  identity.Add("loss", has_loss ? ExactNumber(loss) : why);
  return identity;
}

// A column a point: x, y, L, calls.
Eigen::MatrixXd PointsOf(const PointProblem& problem, const PointPath& path) {
  const Eigen::Index num_x = problem.start.size();
  const Eigen::Index num_y = problem.target.size();
  Eigen::MatrixXd points =
      Eigen::MatrixXd::Constant(num_x + num_y + 2,
                                static_cast<Eigen::Index>(path.x.size()),
                                std::nan(""));
  for (size_t k = 0; k < path.x.size(); ++k) {
    auto point = points.col(k);
    point.head(num_x) = path.x[k];
    if (path.y[k].size() > 0) point.segment(num_x, num_y) = path.y[k];
    point[num_x + num_y] = path.loss[k];
    if (!path.calls.empty()) point[num_x + num_y + 1] = path.calls[k];
  }
  return points;
}

PointPath PathOf(const PointProblem& problem,
                 const Method& method,
                 const MinimizationRecord& record) {
  const Eigen::Index num_x = problem.start.size();
  const Eigen::Index num_y = problem.target.size();
  PointPath path;
  path.label = method.label;
  path.summary = record.summary;
  path.status = record.status;
  for (Eigen::Index k = 0; k < record.points.cols(); ++k) {
    const auto point = record.points.col(k);
    const Eigen::VectorXd y = point.segment(num_x, num_y);
    path.x.emplace_back(point.head(num_x));
    path.y.push_back(y.array().isNaN().all() ? Eigen::VectorXd() : y);
    path.loss.push_back(point[num_x + num_y]);
    if (!problem.simulator->forms_jacobian()) {
      path.calls.push_back(point[num_x + num_y + 1]);
    }
  }
  SetDistancesAndTimes(problem, &path);
  return path;
}

}  // namespace

MinimizerOptions PointBudget() {
  MinimizerOptions options;
  options.max_num_iterations = 100;
  options.gradient_tolerance = 1e-12;
  return options;
}

bool ListPointRun(const std::string& prefix,
                  const Method& method,
                  std::string* error) {
  const std::string name = prefix + FileName(method.label);
  return ListRunFile(name + ".csv", error) && ListRunFile(name + ".run", error);
}

bool RunOrReadPath(const std::string& prefix,
                   const PointProblem& problem,
                   const Method& method,
                   const MinimizerOptions& options,
                   bool may_run,
                   PointPath* path,
                   std::string* error) {
  const std::string file = prefix + FileName(method.label) + ".run";
  const RunIdentity identity = IdentityOf(problem, method);
  MinimizationRecord record;
  std::string why;
  if (ReadRecord(file, identity, options, &record, &why)) {
    *path = PathOf(problem, method, record);
    return true;
  }
  if (!why.empty() || !may_run ||
      !TracePath(problem, method, options, path, &why)) {
    *path = PointPath();
    path->label = method.label;
    path->status = why;
    return true;
  }
  record = MinimizationRecord();
  record.summary = path->summary;
  record.status = path->status;
  record.has_failed = path->has_failed();
  record.points = PointsOf(problem, *path);
  return WritePathCsv(prefix, *path, error) &&
         WriteRecord(file, identity, options, record, error);
}

}  // namespace invgrad
