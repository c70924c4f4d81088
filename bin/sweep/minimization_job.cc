#include "bin/sweep/minimization_job.h"

#include <memory>
#include <string_view>

#include "bin/estimate/estimation_results.h"
#include "bin/estimate/estimation_run.h"
#include "bin/estimate/least_squares_estimation.h"
#include "bin/support/point_run.h"
#include "bin/support/run_output.h"

namespace invgrad {
namespace {

std::string NameOf(const SweepJob& job) { return "jobs/" + job.name; }

Way WayOf(const SweepJob& job) { return {job.method, false, job.method.label}; }

std::unique_ptr<Estimation> EstimationOf(const SweepJob& job,
                                         const TrainingFlags& flags,
                                         std::string* why) {
  const LeastSquaresProblem& problem = *job.problem->least_squares;
  MinimizerOptions budget = LeastSquaresBudget(problem);
  flags.SetBudget(&budget);
  return MakeLeastSquaresEstimation(problem, budget, {job.seed}, why);
}

// `costs`: after each iteration.
void SetResult(const SweepJob& job,
               const MinimizerSummary& summary,
               const std::vector<double>& costs,
               const std::string& status,
               LearningRunResult* result) {
  *result = LearningRunResult();
  result->label = job.method.label;
  result->seed = job.seed;
  for (size_t k = 0; k < costs.size(); ++k) {
    HistoryRow& row = result->history.emplace_back();
    row.step = static_cast<long>(k);
    if (k < summary.iterations.size()) {
      row.seconds = summary.iterations[k].cumulative_time_in_seconds;
    }
    row.train_loss = costs[k];
  }
  // A run that failed at its start has no cost.
  if (result->history.empty()) result->history.emplace_back();
  result->summary.termination_type = summary.termination_type;
  result->summary.message = status;
  result->summary.num_steps = summary.num_steps();
  result->summary.train_time_in_seconds = summary.total_time_in_seconds;
}

bool RunOrReadLeastSquares(const SweepJob& job,
                           const TrainingFlags& flags,
                           bool may_run,
                           LearningRunResult* result,
                           std::string* why) {
  const std::unique_ptr<Estimation> estimation = EstimationOf(job, flags, why);
  if (estimation == nullptr) return false;
  EstimationOptions options;
  options.threads = flags.threads;
  estimation->SetStart(0);
  EstimationRun run;
  if (!RunOrReadEstimation(options,
                           NameOf(job),
                           WayOf(job),
                           may_run,
                           estimation.get(),
                           &run,
                           why)) {
    return false;
  }
  constexpr std::string_view kNotRun = "not run: ";
  const std::string& status = run.row.status;
  if (status.rfind(kNotRun, 0) == 0) {
    *why = status.substr(kNotRun.size());
    return false;
  }
  const MinimizerSummary& summary = run.report.minimizer;
  SetResult(job, summary, Costs(summary), status, result);
  return !status.empty();
}

bool RunOrReadPoint(const SweepJob& job,
                    const TrainingFlags& flags,
                    bool may_run,
                    LearningRunResult* result,
                    std::string* why) {
  const PointProblem& problem = *job.problem->point;
  MinimizerOptions options = PointBudget();
  flags.SetBudget(&options);
  PointPath path;
  if (!PathsFitInMemory(problem, options.max_num_iterations, 1, why) ||
      (may_run && !MakeDirectories(InOutput(NameOf(job)), why)) ||
      !RunOrReadPath(InOutput(NameOf(job) + "/"),
                     problem,
                     job.method,
                     options,
                     may_run,
                     &path,
                     why)) {
    return false;
  }
  if (path.x.empty()) {
    *why = path.status;
    return false;
  }
  SetResult(job, path.summary, path.loss, path.status, result);
  return true;
}

}  // namespace

bool ListMinimizationJob(const SweepJob& job, std::string* error) {
  if (job.problem->point.has_value()) {
    return ListPointRun(InOutput(NameOf(job) + "/"), job.method, error);
  }
  const std::unique_ptr<Estimation> estimation =
      EstimationOf(job, TrainingFlags(), error);
  return estimation != nullptr &&
         ListEstimationRun(
             EstimationOptions(), NameOf(job), WayOf(job), *estimation, error);
}

bool RunOrReadMinimization(const SweepJob& job,
                           const TrainingFlags& flags,
                           bool may_run,
                           LearningRunResult* result,
                           std::string* why) {
  why->clear();
  return job.problem->point.has_value()
             ? RunOrReadPoint(job, flags, may_run, result, why)
             : RunOrReadLeastSquares(job, flags, may_run, result, why);
}

}  // namespace invgrad
