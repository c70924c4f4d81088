#include "bin/estimate/estimation_comparison.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <utility>

#include "bin/estimate/estimation_table.h"
#include "bin/estimate/run_report.h"
#include "bin/estimate/way.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "invgrad/blas_threads.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "problems/estimation/robust_loss.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

struct Runs {
  std::vector<EstimationRow> rows;
  std::vector<Picture> pictures;  // drawn when all tables are written
};

std::string Status(const Method& method, const MinimizerSummary& summary) {
  const ceres::TerminationType type = summary.termination_type;
  if (type == ceres::USER_SUCCESS) return "interrupted";
  if (type != ceres::CONVERGENCE && type != ceres::NO_CONVERGENCE) {
    return "failed: " + summary.message;
  }
  const bool is_late =  // the message is of Ceres or ours
      summary.message.rfind("Maximum solver time", 0) == 0;
  std::string status = type == ceres::CONVERGENCE ? "converged"
                       : is_late                  ? "time used up"
                                                  : "not converged";
  // The number of steps that the rule proposed.
  const size_t proposals = summary.message.find("; ");
  if (method.last_phase().ceres != nullptr &&
      method.last_phase().rule != nullptr && proposals != std::string::npos) {
    status += summary.message.substr(proposals);
  } else if (summary.num_outside_domain > 0) {
    status +=
        fmt::format("; {} outside the domain", summary.num_outside_domain);
    if (summary.first_outside_domain) {
      status += ": " + summary.first_outside_domain->ToText();
    }
  }
  return status;
}

void SetResults(const Method& method,
                const MinimizerSummary& summary,
                const Estimation& estimation,
                EstimationRow* row) {
  // The cost is -1 if the run failed at its start.
  if (summary.initial_cost >= 0.0) row->initial_cost = summary.initial_cost;
  if (summary.final_cost >= 0.0) row->final_cost = summary.final_cost;
  row->num_iterations = summary.num_steps();
  for (size_t k = 1; k < summary.iterations.size(); ++k) {
    ++(summary.iterations[k].step_is_successful ? row->num_accepted
                                                : row->num_rejected);
  }
  row->num_outside_domain = summary.num_outside_domain;
  row->seconds = summary.total_time_in_seconds;
  row->digits = estimation.Digits();
  row->status = Status(method, summary);
  row->has_failed = summary.termination_type == ceres::FAILURE ||
                    summary.termination_type == ceres::USER_FAILURE;
}

std::string IterationsCsv(const MinimizerSummary& summary) {
  std::string csv = "iteration,cost,seconds,accepted\n";
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    csv += fmt::format("{},{:.17g},{:.17g},{:d}\n",
                       iteration.iteration,
                       iteration.cost,
                       iteration.cumulative_time_in_seconds,
                       iteration.step_is_successful);
  }
  return csv;
}

// Costs against iterations and against seconds.
void AddCosts(const std::string& label,
              const MinimizerSummary& summary,
              std::vector<Plot>* panels) {
  Series iterations;
  iterations.title = label;
  Series seconds = iterations;
  double cost = summary.initial_cost;  // a rejected step keeps it
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    if (iteration.step_is_successful) cost = iteration.cost;
    iterations.x.push_back(iteration.iteration);
    iterations.y.push_back(cost);
    seconds.x.push_back(iteration.cumulative_time_in_seconds);
    seconds.y.push_back(cost);
  }
  (*panels)[0].series.push_back(std::move(iterations));
  (*panels)[1].series.push_back(std::move(seconds));
}

std::string StartName(const EstimationInput& input, int start, int seed) {
  std::string name = input.name;
  if (input.estimation->traits().num_starts > 1) {
    name += fmt::format("-start{}", start + 1);
  }
  if (FLAGS_perturb > 0.0) name += fmt::format("-seed{}", seed);
  return name;
}

void SetStart(int start, int seed, Estimation* estimation) {
  estimation->SetStart(start);
  if (FLAGS_perturb > 0.0) {
    NumpyRandom random(static_cast<std::uint32_t>(seed));
    estimation->Perturb(FLAGS_perturb, &random);
  }
}

bool Minimize(const std::string& name,
              Way way,
              Estimation* estimation,
              ceres::Problem* problem,
              MinimizerSummary* summary,
              std::string* error) {
  MinimizerOptions minimizer = estimation->traits().budget;
  if (FLAGS_max_iterations > 0) {
    minimizer.max_num_iterations = FLAGS_max_iterations;
  }
  if (FLAGS_seconds > 0.0) minimizer.max_time_in_seconds = FLAGS_seconds;
  if (FLAGS_function_tolerance >= 0.0) {
    minimizer.function_tolerance = FLAGS_function_tolerance;
  }
  minimizer.block_name = [estimation](const double* values) {
    return estimation->BlockName(values);
  };
  LiveCallback live(name + " " + way.label);
  minimizer.callbacks.push_back(&live);
  way.method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver},
       {"num_threads", std::to_string(FLAGS_threads)}});
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

// All ways from one start.
bool RunFrom(int start,
             int seed,
             const EstimationInput& input,
             const std::vector<Way>& ways,
             const MakeLossFunction& make_loss,
             Runs* runs,
             std::string* error) {
  Estimation* estimation = input.estimation.get();
  const std::string name = StartName(input, start, seed);
  const std::string folder = FLAGS_output + "/" + name;
  if (!MakeDirectories(folder, error)) return false;
  SetStart(start, seed, estimation);
  std::vector<Plot> panels;
  estimation->Draw("start", &panels);
  std::vector<Plot> covariance_panels;
  std::vector<Plot> costs(2);
  costs[0].x_label = "iteration";
  costs[1].x_label = "seconds";
  costs[0].y_label = costs[1].y_label = "cost";
  costs[0].log_y = costs[1].log_y = true;
  for (const Way& way : ways) {
    if (Interrupt::IsRequested()) break;
    SetStart(start, seed, estimation);
    EstimationRow& row = runs->rows.emplace_back();
    row.start = name;
    row.method = way.label;
    RunReport report;
    report.start = name;
    report.method = way.label;
    const std::unique_ptr<ceres::Problem> problem =
        estimation->MakeProblem(make_loss);
    std::string why;
    if (!Minimize(
            name, way, estimation, problem.get(), &report.minimizer, &why)) {
      row.status = "not run: " + why;
      continue;
    }
    SetResults(way.method, report.minimizer, *estimation, &row);
    if (FLAGS_covariance && !row.has_failed) {
      SetCovariance(*problem, *estimation, &row, &report);
    }
    if (!WriteRun(folder + "/" + FileName(way.label),
                  *estimation,
                  &row,
                  &report,
                  error)) {
      return false;
    }
    estimation->Draw(way.label, &panels);
    if (report.covariance) {
      estimation->DrawCovariance(
          way.label, *report.covariance, &covariance_panels);
    }
    AddCosts(way.label, report.minimizer, &costs);
  }
  runs->pictures.push_back({folder + "/result.png", std::move(panels)});
  if (!covariance_panels.empty()) {
    runs->pictures.push_back(
        {folder + "/covariance.png", std::move(covariance_panels)});
  }
  if (!costs[0].series.empty()) {
    std::vector<std::string> labels;
    for (const Series& series : costs[0].series) {
      labels.push_back(series.title);
    }
    labels = ShortNames(labels);
    for (Plot& panel : costs) {
      for (size_t i = 0; i < labels.size(); ++i) {
        panel.series[i].title = labels[i];
      }
    }
    runs->pictures.push_back({folder + "/cost.png", std::move(costs)});
  }
  return true;
}

}  // namespace

bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        RunCounts* counts,
                        std::string* error) {
  std::vector<int> seeds;
  MakeLossFunction make_loss;
  if (!CheckFlag("separable", {"off", "on", "both"}, error) ||
      !CheckFlag("start", {"1", "2", "both"}, error) ||
      !CheckFlags({{"perturb", {0.0}},
                   {"max_iterations", {0.0}},
                   {"seconds", {0.0}},
                   {"function_tolerance", {0.0, 1.0, false, true}},
                   {"threads", {1.0, 256.0}}},
                  error) ||
      !ParseFlag("seeds", ParseSeeds, &seeds, error) ||
      !ParseFlag("loss", ParseRobustLoss, &make_loss, error)) {
    return false;
  }
  for (const EstimationInput& input : inputs) {
    if (FLAGS_start == "2" && input.estimation->traits().num_starts < 2) {
      *error = "--start=2: " + input.name + " has one start";
      return false;
    }
    std::cout << input.name << ": " << input.estimation->traits().description
              << "\n";
  }
  std::cout << "\n";
  SetBlasThreads(FLAGS_threads);
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, error)) return false;
  if (FLAGS_perturb == 0.0) seeds = {0};
  const Interrupt interrupt;
  Runs runs;
  for (const EstimationInput& input : inputs) {
    for (int start = 0; start < input.estimation->traits().num_starts;
         ++start) {
      if (FLAGS_start != "both" && FLAGS_start != std::to_string(start + 1)) {
        continue;
      }
      for (const int seed : seeds) {
        if (Interrupt::IsRequested()) break;
        if (!RunFrom(start,
                     seed,
                     input,
                     Ways(methods, FLAGS_separable),
                     make_loss,
                     &runs,
                     error)) {
          return false;
        }
      }
    }
  }
  const Table table = EstimationTable(runs.rows, /*is_exact=*/false);
  const Table summary = EstimationSummary(runs.rows);
  std::cout << table.ToText() << "\n" << summary.ToText();
  if (!WriteTable(FLAGS_output + "/table", table, error) ||
      !WriteTable(FLAGS_output + "/summary", summary, error) ||
      !WriteRunFile(FLAGS_output + "/results.csv",
                    EstimationTable(runs.rows, /*is_exact=*/true).ToCsv(),
                    error)) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  DrawPictures(runs.pictures);
  for (const EstimationRow& row : runs.rows) counts->Add(!row.has_failed);
  return true;
}

}  // namespace invgrad
