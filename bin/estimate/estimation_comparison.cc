#include "bin/estimate/estimation_comparison.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <utility>

#include "bin/estimate/estimation_table.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/results.h"
#include "bin/support/run_directory.h"
#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/minimize/method_minimization.h"
#include "report/interrupt.h"
#include "report/plot.h"

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

EstimationRow MakeRow(const std::string& start,
                      const Method& method,
                      const MinimizerSummary& summary,
                      const Estimation& estimation) {
  EstimationRow row;
  row.start = start;
  row.method = method.label;
  // The cost is -1 if the run failed at its start.
  if (summary.initial_cost >= 0.0) row.initial_cost = summary.initial_cost;
  if (summary.final_cost >= 0.0) row.final_cost = summary.final_cost;
  row.num_iterations = summary.num_steps();
  for (size_t k = 1; k < summary.iterations.size(); ++k) {
    ++(summary.iterations[k].step_is_successful ? row.num_accepted
                                                : row.num_rejected);
  }
  row.seconds = summary.total_time_in_seconds;
  row.digits = estimation.Digits();
  row.status = Status(method, summary);
  return row;
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
  double cost = summary.initial_cost;  // a rejected step does not change the
                                       // cost
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
  explicit Observer(const std::string& label) : live_(label) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    return live_.Update({iteration.iteration, iteration.cost})
               ? ceres::SOLVER_CONTINUE
               : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  LiveRun live_;
};

class Comparison {
 public:
  Comparison(const std::vector<Method>& methods,
             const EstimationComparisonOptions& options)
      : methods_(methods), options_(options) {}

  const std::vector<EstimationRow>& rows() const { return rows_; }

  // All methods from one start.
  bool Run(const EstimationInput& input,
           int start,
           int seed,
           std::string* error) {
    Estimation* estimation = input.estimation.get();
    const std::string name = StartName(input, start, seed);
    const std::string folder = options_.output + "/" + name;
    std::error_code failure;
    std::filesystem::create_directories(folder, failure);
    if (failure) {
      *error = folder + ": " + failure.message();
      return false;
    }
    SetStart(start, seed, estimation);
    std::vector<Plot> panels;
    estimation->Draw("start", &panels);
    std::vector<Plot> costs(2);
    costs[0].x_label = "iteration";
    costs[1].x_label = "seconds";
    costs[0].y_label = costs[1].y_label = "cost";
    costs[0].log_y = costs[1].log_y = true;
    for (const Method& method : methods_) {
      if (Interrupt::IsRequested()) break;
      SetStart(start, seed, estimation);
      MinimizerSummary summary;
      std::string why;
      if (!Minimize(name, method, estimation, &summary, &why)) {
        EstimationRow row;
        row.start = name;
        row.method = method.label;
        row.status = "not run: " + why;
        row.was_run = false;
        rows_.push_back(std::move(row));
        continue;
      }
      rows_.push_back(MakeRow(name, method, summary, *estimation));
      estimation->Draw(method.label, &panels);
      AddCosts(method.label, summary, &costs);
      const std::string file = folder + "/" + FileName(method.label);
      if (!WriteFile(file + ".csv", IterationsCsv(summary), error)) {
        return false;
      }
      // If estimates are not finite, the other runs continue.
      if (!estimation->Write(file + estimation->Extension(), &why)) {
        Warn(why);
        rows_.back().status += "; no result file: " + why;
      }
    }
    DrawPicture(folder + "/result.png", panels);
    if (!costs[0].series.empty()) {
      MuteAllButTheLowest(&costs);
      DrawPicture(folder + "/cost.png", costs);
    }
    return true;
  }

 private:
  std::string StartName(const EstimationInput& input,
                        int start,
                        int seed) const {
    std::string name = input.name;
    if (input.estimation->num_starts() > 1) {
      name += fmt::format("-start{}", start + 1);
    }
    if (options_.perturbation > 0.0) name += fmt::format("-seed{}", seed);
    return name;
  }

  void SetStart(int start, int seed, Estimation* estimation) const {
    estimation->SetStart(start);
    if (options_.perturbation > 0.0) {
      NumpyRandom random(static_cast<std::uint32_t>(seed));
      estimation->Perturb(options_.perturbation, &random);
    }
  }

  bool Minimize(const std::string& name,
                const Method& method,
                Estimation* estimation,
                MinimizerSummary* summary,
                std::string* error) const {
    MinimizerOptions minimizer;
    estimation->SetBudget(&minimizer);
    if (options_.max_num_iterations > 0) {
      minimizer.max_num_iterations = options_.max_num_iterations;
    }
    if (options_.max_time_in_seconds > 0.0) {
      minimizer.max_time_in_seconds = options_.max_time_in_seconds;
    }
    if (options_.function_tolerance >= 0.0) {
      minimizer.function_tolerance = options_.function_tolerance;
    }
    Observer observer(name + " " + method.label);
    minimizer.callbacks.push_back(&observer);
    Method with_defaults = method;
    with_defaults.AddCeresDefaults(
        {{"linear_solver", estimation->LinearSolver()},
         {"num_threads", std::to_string(options_.num_threads)}});
    const std::unique_ptr<ceres::Problem> problem =
        estimation->MakeProblem(options_.make_loss);
    return MinimizeProblem(with_defaults,
                           minimizer,
                           estimation->MakeOrdering(),
                           problem.get(),
                           summary,
                           error);
  }

  const std::vector<Method>& methods_;
  const EstimationComparisonOptions& options_;
  std::vector<EstimationRow> rows_;
};

}  // namespace

bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        const EstimationComparisonOptions& options,
                        std::ostream& out,
                        std::string* error) {
  const Interrupt interrupt;
  Comparison comparison(methods, options);
  const std::vector<int> seeds =
      options.perturbation > 0.0 ? options.seeds : std::vector<int>{0};
  for (const EstimationInput& input : inputs) {
    for (const int start : options.starts) {
      if (start >= input.estimation->num_starts()) continue;
      for (const int seed : seeds) {
        if (Interrupt::IsRequested()) break;
        if (!comparison.Run(input, start, seed, error)) return false;
      }
    }
  }
  const std::vector<EstimationRow>& rows = comparison.rows();
  const Table table = EstimationTable(rows);
  const Table summary = EstimationSummary(rows);
  out << table.ToText() << "\n" << summary.ToText();
  if (!WriteTable(options.output + "/table", table, error) ||
      !WriteTable(options.output + "/summary", summary, error) ||
      !WriteFile(options.output + "/results.csv", EstimationCsv(rows), error)) {
    return false;
  }
  out << "results in " << options.output << "\n";
  *error = "no method could run";
  return std::any_of(rows.begin(), rows.end(), [](const EstimationRow& row) {
    return row.was_run;
  });
}

}  // namespace invgrad
