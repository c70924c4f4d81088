#include "bin/estimate/estimation_results.h"

#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/minimize/within_bounds.h"

namespace invgrad {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::string Status(const Method& method, const MinimizerSummary& summary) {
  const ceres::TerminationType type = summary.termination_type;
  if (type == ceres::FAILURE || type == ceres::USER_FAILURE) {
    return "failed: " + summary.message;
  }
  if (!std::isfinite(summary.final_cost)) {
    return "failed: the cost is not finite";
  }
  if (type == ceres::USER_SUCCESS) return "interrupted";
  const bool is_late =  // the message is of Ceres or ours
      summary.message.rfind("Maximum solver time", 0) == 0;
  const bool is_at_bounds =
      summary.message.rfind(kNoMinimumWithinBounds, 0) == 0;
  std::string status = type == ceres::CONVERGENCE ? "converged"
                       : is_late                  ? "time used up"
                       : is_at_bounds ? "not at a minimum within the bounds"
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

double SecondsTo(double level, const MinimizerSummary& summary) {
  const std::vector<double> costs = Costs(summary);
  for (size_t k = 0; k < costs.size(); ++k) {
    if (costs[k] <= level) {
      return summary.iterations[k].cumulative_time_in_seconds;
    }
  }
  return kNan;
}

// At the current parameters, in the tangent space.
double GradientNorm(ceres::Problem* problem) {
  std::vector<double> gradient;
  if (!problem->Evaluate({}, nullptr, nullptr, &gradient, nullptr)) return kNan;
  return Eigen::Map<const Eigen::VectorXd>(
             gradient.data(), static_cast<Eigen::Index>(gradient.size()))
      .norm();
}

}  // namespace

std::vector<double> Costs(const MinimizerSummary& summary) {
  std::vector<double> costs;
  double cost = summary.initial_cost;
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    if (iteration.step_is_successful) cost = iteration.cost;
    costs.push_back(cost);
  }
  return costs;
}

void SetResults(const Method& method,
                const MinimizerSummary& summary,
                long num_evaluations,
                const std::vector<double>& levels,
                const Estimation& estimation,
                ceres::Problem* problem,
                EstimationRow* row) {
  // The cost is -1 if the run failed at its start.
  if (summary.initial_cost >= 0.0) row->initial_cost = summary.initial_cost;
  if (summary.final_cost >= 0.0) row->final_cost = summary.final_cost;
  row->constant_cost = estimation.ConstantCost();
  row->num_iterations = summary.num_steps();
  for (size_t k = 1; k < summary.iterations.size(); ++k) {
    ++(summary.iterations[k].step_is_successful ? row->num_accepted
                                                : row->num_rejected);
  }
  row->num_outside_domain = summary.num_outside_domain;
  row->seconds = summary.total_time_in_seconds;
  row->num_evaluations = num_evaluations;
  if (row->num_evaluations >= 0) row->gradient_norm = GradientNorm(problem);
  for (const double level : levels) {
    row->seconds_to.push_back(SecondsTo(estimation.minimum() + level, summary));
  }
  row->is_solved = estimation.IsSolved(row->initial_cost, row->final_cost);
  row->digits = estimation.Digits();
  row->status = Status(method, summary);
  row->has_failed = summary.termination_type == ceres::FAILURE ||
                    summary.termination_type == ceres::USER_FAILURE ||
                    !std::isfinite(summary.final_cost);
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

}  // namespace invgrad
