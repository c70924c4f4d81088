#include "bin/estimate/estimation_run.h"

#include <filesystem>
#include <memory>

#include "bin/estimate/estimation_results.h"
#include "bin/support/live_run.h"
#include "bin/support/minimization_record.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/io/digest.h"
#include "report/table.h"

namespace invgrad {
namespace {

std::string PathOf(const std::string& start_name, const Way& way) {
  return InOutput(start_name + "/" + FileName(way.label));
}

MinimizerOptions BudgetOf(const EstimationOptions& options,
                          const Estimation& estimation) {
  MinimizerOptions budget = estimation.traits().budget;
  if (options.max_iterations > 0) {
    budget.max_num_iterations = options.max_iterations;
  }
  if (options.seconds > 0.0) budget.max_time_in_seconds = options.seconds;
  if (options.function_tolerance >= 0.0) {
    budget.function_tolerance = options.function_tolerance;
  }
  return budget;
}

// At the start: the residuals are identified by their cost there.
RunIdentity IdentityOf(const std::string& start_name,
                       const Way& way,
                       const ProblemStructure& structure,
                       ceres::Problem* problem) {
  double cost = 0.0;
  const bool has_cost = problem->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  RunIdentity identity;
  identity.Add("start", start_name);
  identity.Add("method", way.label);
  identity.Add("parameters", Digest().Add(structure.State()).Hex());
  identity.Add("cost", has_cost ? ExactNumber(cost) : "none");
  return identity;
}

bool Minimize(const EstimationOptions& options,
              const std::string& start_name,
              Way way,
              MinimizerOptions minimizer,
              Estimation* estimation,
              ceres::Problem* problem,
              MinimizerSummary* summary,
              std::string* error) {
  minimizer.block_name = [estimation](const double* values) {
    return estimation->BlockName(values);
  };
  minimizer.evaluation_callback = estimation->evaluation_callback();
  LiveCallback live(start_name + " " + way.label);
  minimizer.callbacks.push_back(&live);
  way.method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver},
       {"num_threads", std::to_string(options.threads)}});
  return MinimizeByWay(way, minimizer, estimation, problem, summary, error);
}

// Of a run that has a result. A covariance that cannot be computed is part of
// the status.
void SetCovariance(const ceres::Problem& problem,
                   const Estimation& estimation,
                   EstimationRow* row,
                   RunReport* report) {
  std::string why;
  if (!AddCovariance(estimation, problem, report, &why)) {
    row->status += "; no covariance: " + why;
    return;
  }
  row->rank = report->covariance->rank();
  row->num_parameters = report->covariance->num_parameters();
  row->deviation_digits = estimation.DeviationDigits(*report->covariance);
}

// Sets what follows from the record and the estimation at its result.
void SetRow(const EstimationOptions& options,
            const Way& way,
            const MinimizationRecord& record,
            const Estimation& estimation,
            ceres::Problem* problem,
            EstimationRun* run) {
  EstimationRow* row = &run->row;
  run->report.minimizer = record.summary;
  SetResults(way.method,
             record.summary,
             record.num_evaluations,
             options.levels,
             estimation,
             problem,
             row);
  const std::string doubt = estimation.Doubt();
  if (!row->has_failed && !doubt.empty()) row->status += "; " + doubt;
  if (options.covariance && !row->has_failed) {
    SetCovariance(*problem, estimation, row, &run->report);
  }
  row->estimate = estimation.EstimateText(
      run->report.covariance ? &*run->report.covariance : nullptr);
}

// Writes the result, in the input's format, and the reports.
bool WriteRun(const std::string& path,
              const Estimation& estimation,
              EstimationRow* row,
              RunReport* report,
              std::string* error) {
  const std::string result = path + estimation.traits().extension;
  if (!ListRunFile(result, error)) return false;
  // If estimates are not finite, the other runs continue.
  std::string why;
  if (!estimation.Write(result, &why)) {
    Warn(why);
    row->status += "; no result file: " + why;
    row->has_failed = true;
  }
  report->status = row->status;
  return WriteRunFile(path + ".csv", IterationsCsv(report->minimizer), error) &&
         WriteRunFile(path + ".json", report->ToJson(), error) &&
         (!report->covariance ||
          WriteRunFile(path + ".report.txt", report->ToText(), error));
}

}  // namespace

bool ListEstimationRun(const EstimationOptions& options,
                       const std::string& start_name,
                       const Way& way,
                       const Estimation& estimation,
                       std::string* error) {
  const std::string path = PathOf(start_name, way);
  return ListRunFile(path + estimation.traits().extension, error) &&
         ListRunFile(path + ".csv", error) &&
         ListRunFile(path + ".json", error) &&
         ListRunFile(path + ".run", error) &&
         (!options.covariance || ListRunFile(path + ".report.txt", error));
}

bool RunOrReadEstimation(const EstimationOptions& options,
                         const std::string& start_name,
                         const Way& way,
                         bool may_run,
                         Estimation* estimation,
                         EstimationRun* run,
                         std::string* error) {
  EstimationRow& row = run->row;
  row.start = run->report.start = start_name;
  row.method = run->report.method = way.label;
  const std::string path = PathOf(start_name, way);
  std::error_code failure;
  if (!may_run && !std::filesystem::exists(path + ".run", failure)) return true;
  const std::unique_ptr<ceres::Problem> problem =
      estimation->MakeProblem(options.make_loss);
  const ProblemStructure structure = ReadStructure(*problem, {});
  const RunIdentity identity =
      IdentityOf(start_name, way, structure, problem.get());
  const long num_before = estimation->num_evaluations();
  const MinimizerOptions budget = BudgetOf(options, *estimation);
  MinimizationRecord record;
  std::string why;
  if (ReadRecord(path + ".run", identity, budget, &record, &why)) {
    structure.SetState(record.points.col(0));
    SetRow(options, way, record, *estimation, problem.get(), run);
    row.status = record.status;
    row.has_failed = record.has_failed;
    return true;
  }
  if (!may_run && why.empty()) return true;
  if (!MakeDirectories(InOutput(start_name), error)) return false;
  record = MinimizationRecord();
  if (!why.empty() || !Minimize(options,
                                start_name,
                                way,
                                budget,
                                estimation,
                                problem.get(),
                                &record.summary,
                                &why)) {
    row.status = "not run: " + why;
    return true;
  }
  record.points = structure.State();
  if (num_before >= 0) {
    record.num_evaluations = estimation->num_evaluations() - num_before;
  }
  SetRow(options, way, record, *estimation, problem.get(), run);
  if (!WriteRun(path, *estimation, &row, &run->report, error)) return false;
  record.status = row.status;
  record.has_failed = row.has_failed;
  if (!WriteRecord(path + ".run", identity, budget, record, &why)) {
    Warn(why);
    row.status += "; not kept for --resume: " + why;
    row.has_failed = true;
  }
  return true;
}

}  // namespace invgrad
