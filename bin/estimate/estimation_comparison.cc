#include "bin/estimate/estimation_comparison.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/format.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/minimize/method_minimization.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/robust_loss.h"
#include "report/interrupt.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr auto kLeft = Table::Align::kLeft;

struct Row {
  std::string start;   // "Misra1a-start1-seed3": runs from one start compare
  std::string method;  // its label
  double initial_cost = std::numeric_limits<double>::quiet_NaN();
  double final_cost = std::numeric_limits<double>::quiet_NaN();
  int num_iterations = 0;
  int num_accepted = 0;  // steps
  int num_rejected = 0;
  int num_outside_domain = 0;  // candidates
  double seconds = 0.0;
  // Correct digits of every parameter, if there are certified values.
  std::optional<Eigen::VectorXd> digits;
  std::string status;
  bool has_failed = true;
};

struct Runs {
  std::vector<Row> rows;
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
  }
  return status;
}

void SetResults(const Method& method,
                const MinimizerSummary& summary,
                const Estimation& estimation,
                Row* row) {
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
              Method method,
              const MakeLossFunction& make_loss,
              Estimation* estimation,
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
  LiveCallback live(name + " " + method.label);
  minimizer.callbacks.push_back(&live);
  method.AddCeresDefaults(
      {{"linear_solver", estimation->traits().linear_solver},
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
             Runs* runs,
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
    Row& row = runs->rows.emplace_back();
    row.start = name;
    row.method = method.label;
    MinimizerSummary summary;
    std::string why;
    if (!Minimize(name, method, make_loss, estimation, &summary, &why)) {
      row.status = "not run: " + why;
      continue;
    }
    SetResults(method, summary, *estimation, &row);
    estimation->Draw(method.label, &panels);
    AddCosts(method.label, summary, &costs);
    const std::string file = folder + "/" + FileName(method.label);
    const std::string result = file + estimation->traits().extension;
    if (!WriteRunFile(file + ".csv", IterationsCsv(summary), error) ||
        !ListRunFile(result, error)) {
      return false;
    }
    // If estimates are not finite, the other runs continue.
    if (!estimation->Write(result, &why)) {
      Warn(why);
      row.status += "; no result file: " + why;
      row.has_failed = true;
    }
  }
  runs->pictures.push_back({folder + "/result.png", std::move(panels)});
  if (!costs[0].series.empty()) {
    MuteAllButTheLowest(&costs);
    runs->pictures.push_back({folder + "/cost.png", std::move(costs)});
  }
  return true;
}

bool HasDigits(const std::vector<Row>& rows) {
  return std::any_of(rows.begin(), rows.end(), [](const Row& row) {
    return row.digits.has_value();
  });
}

bool IsSolved(const Row& row) {
  return row.digits.has_value() && IsNistSolution(*row.digits);
}

// Counts of a run or of sums of runs.
void AddCounts(const Row& counts, Table* table) {
  table->Add("iterations", std::to_string(counts.num_iterations));
  table->Add("accepted", std::to_string(counts.num_accepted));
  table->Add("rejected", std::to_string(counts.num_rejected));
}

// One row per run, for people; or with all digits, for CSV.
Table EstimationTable(const std::vector<Row>& rows, bool is_exact) {
  const bool has_digits = HasDigits(rows);
  const auto number = [is_exact](double value, int digits) {
    return is_exact ? ExactNumber(value) : FormatNumber(value, digits);
  };
  const std::string none = is_exact ? "" : "-";
  Table table;
  for (const Row& row : rows) {
    table.BeginRow();
    table.Add("start", row.start, kLeft);
    table.Add("method", row.method, kLeft);
    table.Add(is_exact ? "initial_cost" : "initial cost",
              number(row.initial_cost, 7));
    table.Add(is_exact ? "final_cost" : "cost", number(row.final_cost, 7));
    AddCounts(row, &table);
    table.Add(is_exact ? "seconds" : "s", number(row.seconds, 3));
    if (has_digits || is_exact) {
      table.Add("digits",
                row.digits ? number(row.digits->minCoeff(), 3) : none);
      table.Add(is_exact ? "mean_digits" : "mean digits",
                row.digits ? number(row.digits->mean(), 3) : none);
    }
    if (has_digits && !is_exact) {
      table.Add("solved", !row.digits ? "-" : IsSolved(row) ? "yes" : "no");
    }
    table.Add("status", row.status, kLeft);
    if (is_exact) {
      table.Add("outside_domain", std::to_string(row.num_outside_domain));
    }
  }
  return table;
}

// For each method, over all starts: the number of solved starts (by NIST's
// digits); the digits of the worst and of the mean parameter, averaged over the
// solved starts; the number of starts with the least cost of all methods; and
// sums.
Table EstimationSummary(const std::vector<Row>& rows) {
  constexpr double kSameCost = 1e-6;
  std::map<std::string, double> least_cost;
  for (const Row& row : rows) {
    if (!std::isfinite(row.final_cost)) continue;
    const auto [it, is_new] = least_cost.emplace(row.start, row.final_cost);
    if (!is_new) it->second = std::min(it->second, row.final_cost);
  }
  std::vector<std::string> methods;  // in the order of their first runs
  for (const Row& row : rows) {
    if (std::count(methods.begin(), methods.end(), row.method) == 0) {
      methods.push_back(row.method);
    }
  }
  const bool has_digits = HasDigits(rows);
  Table table;
  for (const std::string& method : methods) {
    Row sum;
    int num_runs = 0, num_solved = 0, num_least = 0;
    double worst_digits = 0.0, mean_digits = 0.0;  // sums of the solved runs
    for (const Row& row : rows) {
      if (row.method != method) continue;
      const double least = least_cost[row.start];
      ++num_runs;
      num_least += row.final_cost <= least + kSameCost * std::abs(least);
      if (IsSolved(row)) {
        ++num_solved;
        worst_digits += row.digits->minCoeff();
        mean_digits += row.digits->mean();
      }
      sum.num_iterations += row.num_iterations;
      sum.num_accepted += row.num_accepted;
      sum.num_rejected += row.num_rejected;
      sum.seconds += row.seconds;
    }
    const auto mean = [num_solved](double digits) {
      return num_solved > 0 ? FormatNumber(digits / num_solved, 3) : "-";
    };
    const auto share = [num_runs](int count) {
      return fmt::format("{} of {}", count, num_runs);
    };
    table.BeginRow();
    table.Add("method", method, kLeft);
    table.Add("starts", std::to_string(num_runs));
    table.Add("least cost", share(num_least));
    if (has_digits) {
      table.Add("solved", share(num_solved));
      table.Add("digits", mean(worst_digits));
      table.Add("mean digits", mean(mean_digits));
    }
    AddCounts(sum, &table);
    table.Add("s", FormatNumber(sum.seconds, 3));
  }
  return table;
}

}  // namespace

bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        RunCounts* counts,
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
        if (!RunFrom(start, seed, input, methods, make_loss, &runs, error)) {
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
  for (const Row& row : runs.rows) counts->Add(!row.has_failed);
  return true;
}

}  // namespace invgrad
