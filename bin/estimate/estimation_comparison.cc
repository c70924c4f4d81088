#include "bin/estimate/estimation_comparison.h"

#include <algorithm>
#include <iostream>
#include <utility>

#include "bin/estimate/estimation_table.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/minimize/problem_minimization.h"
#include "problems/estimation/robust_loss.h"
#include "report/interrupt.h"
#include "report/plot.h"

// Of estimate.cc; compare has flags of these names too.
DECLARE_string(start);
DECLARE_string(loss);
DECLARE_double(perturb);
DECLARE_string(seeds);
DECLARE_int32(max_iterations);
DECLARE_double(seconds);
DECLARE_double(function_tolerance);
DECLARE_int32(threads);

namespace invgrad {
namespace {

std::string Status(const Method& method, const MinimizerSummary& summary) {
  std::string status;
  switch (summary.termination_type) {
    case ceres::CONVERGENCE:
      status = "converged";
      break;
    case ceres::NO_CONVERGENCE:
      // Ceres' message, and ours.
      status = summary.message.rfind("Maximum solver time", 0) == 0
                   ? "time used up"
                   : "not converged";
      break;
    case ceres::USER_SUCCESS:
      return "interrupted";
    default:
      return "failed: " + summary.message;
  }
  // The number of steps that the rule proposed.
  const size_t proposals = summary.message.find("; ");
  if (method.last_phase().ceres != nullptr &&
      method.last_phase().rule != nullptr && proposals != std::string::npos) {
    status += summary.message.substr(proposals);
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
  row->seconds = summary.total_time_in_seconds;
  row->digits = estimation.Digits();
  row->status = Status(method, summary);
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

class Observer final : public ceres::IterationCallback {
 public:
  explicit Observer(const std::string& label) { state_.label = label; }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    state_.step = iteration.iteration;
    state_.loss = iteration.cost;
    return ShowProgress(state_, &progress_)
               ? ceres::SOLVER_CONTINUE
               : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  ProgressState state_;
  Progress progress_;
};

std::string StartName(const EstimationInput& input, int start, int seed) {
  std::string name = input.name;
  if (input.estimation->num_starts() > 1) {
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
              Method method,
              const MakeLossFunction& make_loss,
              Estimation* estimation,
              MinimizerSummary* summary,
              std::string* error) {
  MinimizerOptions minimizer;
  estimation->SetBudget(&minimizer);
  if (FLAGS_max_iterations > 0) {
    minimizer.max_num_iterations = FLAGS_max_iterations;
  }
  if (FLAGS_seconds > 0.0) minimizer.max_time_in_seconds = FLAGS_seconds;
  if (FLAGS_function_tolerance >= 0.0) {
    minimizer.function_tolerance = FLAGS_function_tolerance;
  }
  Observer observer(name + " " + method.label);
  minimizer.callbacks.push_back(&observer);
  method.AddCeresDefaults({{"linear_solver", estimation->LinearSolver()},
                           {"num_threads", std::to_string(FLAGS_threads)}});
  const std::unique_ptr<ceres::Problem> problem =
      estimation->MakeProblem(make_loss);
  return MinimizeProblem(method,
                         minimizer,
                         estimation->MakeOrdering(),
                         problem.get(),
                         summary,
                         error);
}

// All methods from one start.
bool RunFrom(int start,
             int seed,
             const EstimationInput& input,
             const std::vector<Method>& methods,
             const MakeLossFunction& make_loss,
             std::vector<EstimationRow>* rows,
             std::string* error) {
  Estimation* estimation = input.estimation.get();
  const std::string name = StartName(input, start, seed);
  const std::string folder = FLAGS_output + "/" + name;
  if (!MakeDirectories(folder, error)) return false;
  SetStart(start, seed, estimation);
  std::vector<Plot> panels;
  estimation->Draw("start", &panels);
  std::vector<Plot> costs(2);
  costs[0].x_label = "iteration";
  costs[1].x_label = "seconds";
  costs[0].y_label = costs[1].y_label = "cost";
  costs[0].log_y = costs[1].log_y = true;
  for (const Method& method : methods) {
    if (Interrupt::IsRequested()) break;
    SetStart(start, seed, estimation);
    EstimationRow& row = rows->emplace_back();
    row.start = name;
    row.method = method.label;
    MinimizerSummary summary;
    std::string why;
    row.was_run = Minimize(name, method, make_loss, estimation, &summary, &why);
    if (!row.was_run) {
      row.status = "not run: " + why;
      continue;
    }
    SetResults(method, summary, *estimation, &row);
    estimation->Draw(method.label, &panels);
    AddCosts(method.label, summary, &costs);
    const std::string file = folder + "/" + FileName(method.label);
    if (!WriteFile(file + ".csv", IterationsCsv(summary), error)) return false;
    // If estimates are not finite, the other runs continue.
    if (!estimation->Write(file + estimation->Extension(), &why)) {
      Warn(why);
      row.status += "; no result file: " + why;
    }
  }
  DrawPicture(folder + "/result.png", panels);
  if (!costs[0].series.empty()) {
    MuteAllButTheLowest(&costs);
    DrawPicture(folder + "/cost.png", costs);
  }
  return true;
}

}  // namespace

bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        std::string* error) {
  std::vector<int> seeds;
  MakeLossFunction make_loss;
  if (!CheckFlag("start", {"1", "2", "both"}, error) ||
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
    if (FLAGS_start == "2" && input.estimation->num_starts() < 2) {
      *error = "--start=2: " + input.name + " has one start";
      return false;
    }
    std::cout << input.name << ": " << input.estimation->Description() << "\n";
  }
  std::cout << "\n";
  SetBlasThreads(FLAGS_threads);
  if (!PrepareRunDirectory(ExistingDirectory::kRefuse, error)) return false;
  if (FLAGS_perturb == 0.0) seeds = {0};
  const Interrupt interrupt;
  std::vector<EstimationRow> rows;
  for (const EstimationInput& input : inputs) {
    for (int start = 0; start < input.estimation->num_starts(); ++start) {
      if (FLAGS_start != "both" && FLAGS_start != std::to_string(start + 1)) {
        continue;
      }
      for (const int seed : seeds) {
        if (Interrupt::IsRequested()) break;
        if (!RunFrom(start, seed, input, methods, make_loss, &rows, error)) {
          return false;
        }
      }
    }
  }
  const Table table = EstimationTable(rows, /*is_exact=*/false);
  const Table summary = EstimationSummary(rows);
  std::cout << table.ToText() << "\n" << summary.ToText();
  if (!WriteTable(FLAGS_output + "/table", table, error) ||
      !WriteTable(FLAGS_output + "/summary", summary, error) ||
      !WriteFile(FLAGS_output + "/results.csv",
                 EstimationTable(rows, /*is_exact=*/true).ToCsv(),
                 error)) {
    return false;
  }
  std::cout << "results in " << FLAGS_output << "\n";
  *error = "no method could run";
  return std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
    return row.was_run;
  });
}

}  // namespace invgrad
