#include "bin/support/point_path.h"

#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "bin/support/live_run.h"
#include "bin/support/run_output.h"
#include "fmt/ranges.h"
#include "invgrad/chain/counted_simulator.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/method.h"

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
  PointObjective objective = counted.MakeObjective();
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
  // A failed step is not in the path: the last point is the last good one.
  for (const Eigen::VectorXd& x : path->x) {
    objective.SetState(x);
    path->y.push_back(objective.Outputs());
    double loss = 0.0;
    std::string ignored;
    path->loss.push_back(objective.Cost(&loss, &ignored) ? loss : kNan);
  }
  SetDistancesAndTimes(problem, path);
  path->status = Status(path->summary);
  return true;
}

void SetDistancesAndTimes(const PointProblem& problem, PointPath* path) {
  const auto& iterations = path->summary.iterations;
  for (size_t k = 0; k < path->x.size(); ++k) {
    path->distance.push_back(problem.minimizer.has_value()
                                 ? (path->x[k] - *problem.minimizer).norm()
                                 : kNan);
    path->seconds.push_back(k < iterations.size()
                                ? iterations[k].cumulative_time_in_seconds
                                : kNan);
  }
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

}  // namespace invgrad
