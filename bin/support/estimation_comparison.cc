#include "bin/support/estimation_comparison.h"

#include <filesystem>
#include <limits>
#include <sstream>
#include <utility>

#include "bin/support/estimation_table.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/minimize/problem_minimization.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/progress.h"

namespace invgrad {

namespace {

// Shows a run, and ends it on Ctrl-C.
class Observer final : public ceres::IterationCallback {
 public:
  Observer(std::string label, bool shows_progress)
      : shows_progress_(shows_progress) {
    state_.label = std::move(label);
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    state_.step = iteration.iteration;
    state_.loss = iteration.cost;
    if (shows_progress_) progress_.Update(state_);
    return Interrupt::IsRequested() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                    : ceres::SOLVER_CONTINUE;
  }

 private:
  const bool shows_progress_;
  ProgressState state_;
  Progress progress_;
};

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
  // How many steps the rule proposed.
  const size_t proposals = summary.message.find("; ");
  if (method.last_phase().ceres != nullptr &&
      method.last_phase().rule != nullptr && proposals != std::string::npos) {
    status += summary.message.substr(proposals);
  }
  return status;
}

// Of a run that failed at its start, Ceres and we say -1.
double KnownCost(double cost) {
  return cost >= 0.0 ? cost : std::numeric_limits<double>::quiet_NaN();
}

EstimationRow MakeRow(const std::string& start,
                      const Method& method,
                      const MinimizerSummary& summary,
                      const Estimation& estimation) {
  EstimationRow row;
  row.start = start;
  row.method = method.label;
  row.initial_cost = KnownCost(summary.initial_cost);
  row.final_cost = KnownCost(summary.final_cost);
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
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  csv << "iteration,cost,seconds,accepted\n";
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    csv << iteration.iteration << ',' << iteration.cost << ','
        << iteration.cumulative_time_in_seconds << ','
        << (iteration.step_is_successful ? 1 : 0) << '\n';
  }
  return csv.str();
}

Plot CostPanel(const std::string& x_label) {
  Plot plot;
  plot.x_label = x_label;
  plot.y_label = "cost";
  plot.log_y = true;
  return plot;
}

// A rejected step leaves the cost where it was.
void AddCosts(const std::string& label,
              const MinimizerSummary& summary,
              Plot* against_iterations,
              Plot* against_seconds) {
  Series iterations;
  iterations.title = label;
  Series seconds = iterations;
  double cost = summary.initial_cost;
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    if (iteration.step_is_successful) cost = iteration.cost;
    iterations.x.push_back(iteration.iteration);
    iterations.y.push_back(cost);
    seconds.x.push_back(iteration.cumulative_time_in_seconds);
    seconds.y.push_back(cost);
  }
  against_iterations->series.push_back(std::move(iterations));
  against_seconds->series.push_back(std::move(seconds));
}

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
    const auto set_start = [&]() {
      estimation->SetStart(start);
      if (options_.perturbation > 0.0) {
        NumpyRandom random(static_cast<std::uint32_t>(seed));
        estimation->Perturb(options_.perturbation, &random);
      }
    };
    set_start();
    std::vector<Plot> panels;
    estimation->Draw("start", &panels);
    std::vector<Plot> costs = {CostPanel("iteration"), CostPanel("seconds")};
    for (const Method& method : methods_) {
      if (Interrupt::IsRequested()) break;
      set_start();
      MinimizerSummary summary;
      std::string why;
      if (!Minimize(name, method, estimation, &summary, &why)) {
        EstimationRow row;
        row.start = name;
        row.method = method.label;
        row.initial_cost = std::numeric_limits<double>::quiet_NaN();
        row.final_cost = row.initial_cost;
        row.status = "not run: " + why;
        rows_.push_back(std::move(row));
        continue;
      }
      rows_.push_back(MakeRow(name, method, summary, *estimation));
      estimation->Draw(method.label, &panels);
      AddCosts(method.label, summary, &costs[0], &costs[1]);
      const std::string file = folder + "/" + FileName(method.label);
      if (!WriteFile(file + ".csv", IterationsCsv(summary), error)) {
        return false;
      }
      // Not a reason to lose the other runs: estimates that are not finite,
      // say.
      if (!estimation->Write(file + estimation->Extension(), &why)) {
        Warn(why);
        rows_.back().status += "; no result file: " + why;
      }
    }
    if (options_.plots) {
      DrawPicture(folder + "/result.png", panels);
      if (!costs.front().series.empty()) {
        DrawPicture(folder + "/cost.png", costs);
      }
    }
    return true;
  }

 private:
  std::string StartName(const EstimationInput& input,
                        int start,
                        int seed) const {
    std::string name = input.name;
    if (input.estimation->num_starts() > 1) {
      name += "-start" + std::to_string(start + 1);
    }
    if (options_.perturbation > 0.0) name += "-seed" + std::to_string(seed);
    return name;
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
    Observer observer(name + " " + method.label, options_.shows_progress);
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

  static void DrawPicture(const std::string& path,
                          const std::vector<Plot>& panels) {
    std::string error;
    if (!WritePlots(path, panels, &error)) Warn(error);
  }

  const std::vector<Method>& methods_;
  const EstimationComparisonOptions& options_;
  std::vector<EstimationRow> rows_;
};

bool WriteTable(const Table& table,
                const std::string& path,
                std::string* error) {
  return WriteFile(path + ".txt", table.ToText(), error) &&
         WriteFile(path + ".md", table.ToMarkdown(), error);
}

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
  const Table table = EstimationTable(comparison.rows());
  const Table summary = EstimationSummary(comparison.rows());
  out << table.ToText() << "\n" << summary.ToText();
  if (!WriteTable(table, options.output + "/table", error) ||
      !WriteTable(summary, options.output + "/summary", error) ||
      !WriteFile(options.output + "/results.csv",
                 EstimationCsv(comparison.rows()),
                 error)) {
    return false;
  }
  out << "results in " << options.output << "\n";
  return true;
}

}  // namespace invgrad
