#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/variable_cost.h"
#include "invgrad/core/hessian_times.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/step_cost.h"
#include "invgrad/internal/logging.h"
#include "invgrad/linearization.h"
#include "invgrad/minimize.h"
#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/stored_jacobian.h"
#include "invgrad/update_rule.h"

namespace invgrad {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

// One run of Minimize.
class Run {
 public:
  // fixed_cost: a part of the cost that the objective leaves out.
  Run(const MinimizerOptions& options,
      UpdateRule* rule,
      Objective* objective,
      double fixed_cost,
      MinimizerSummary* summary)
      : options_(options),
        rule_(rule),
        judge_(rule->judge()),
        objective_(objective),
        fixed_cost_(fixed_cost),
        summary_(summary),
        parts_(rule->Needs()) {
    // The gradient is cheap compared with the Jacobian, which every part needs.
    parts_.gradient = true;
  }

  void Minimize() {
    for (bool goes_on = Start(); goes_on;) goes_on = MayContinue() && Step();
  }

 private:
  bool Start() {
    std::string error;
    if (!objective_->Linearize(parts_, &at_x_, &error)) {
      return Terminate(ceres::FAILURE, "no start: " + error);
    }
    state_ = objective_->State();
    summary_->initial_cost = at_x_.cost + fixed_cost_;
    ceres::IterationSummary iteration;
    iteration.iteration = 0;
    iteration.step_is_successful = true;
    return Record(&iteration);
  }

  // Checks the budget and the gradient before a step.
  bool MayContinue() {
    const double gradient_max_norm = at_x_.gradient.lpNorm<Eigen::Infinity>();
    if (gradient_max_norm <= options_.gradient_tolerance) {
      return Terminate(
          ceres::CONVERGENCE,
          fmt::format(
              "Gradient tolerance reached. Gradient max norm: {:e} <= {:e}",
              gradient_max_norm,
              options_.gradient_tolerance));
    }
    if (summary_->num_steps() >= options_.max_num_iterations) {
      return Terminate(
          ceres::NO_CONVERGENCE,
          fmt::format(
              "Maximum number of iterations reached. Number of iterations: {}",
              summary_->num_steps()));
    }
    const double seconds = Seconds(Clock::now() - start_);
    if (seconds >= options_.max_time_in_seconds) {
      return Terminate(
          ceres::NO_CONVERGENCE,
          fmt::format(
              "Maximum solver time reached. Total solver time: {:e} >= {:e}.",
              seconds,
              options_.max_time_in_seconds));
    }
    const double step_seconds = StepSeconds();
    if (seconds + step_seconds >= options_.max_time_in_seconds) {
      return Terminate(
          ceres::NO_CONVERGENCE,
          fmt::format("Maximum solver time reached. The next step takes about "
                      "{:.2g} s, and {:.2g} s are left.",
                      step_seconds,
                      options_.max_time_in_seconds - seconds));
    }
    std::string error;
    if (!StepFitsInMemory(&error)) return Terminate(ceres::FAILURE, error);
    return true;
  }

  // m; n if J is not computed.
  double NumRows() const {
    return at_x_.jacobian != nullptr ? at_x_.jacobian->rows()
                                     : objective_->num_parameters();
  }

  // Of a sparse J, for a factorization that uses it.
  double NumEntries() const {
    if (!parts_.uses_sparsity) return 0.0;
    const auto* sparse =
        dynamic_cast<const SparseJacobian*>(at_x_.jacobian.get());
    return sparse == nullptr ? 0.0 : sparse->matrix().nonZeros();
  }

  // Of a factorization; 0 for other steps.
  double StepSeconds() const {
    return StepOperations(
               parts_, NumRows(), objective_->num_parameters(), NumEntries()) /
           kOperationsPerSecond;
  }

  bool StepFitsInMemory(std::string* error) const {
    return FitsInMemory("the next step",
                        StepMemory(parts_,
                                   NumRows(),
                                   objective_->num_parameters(),
                                   NumEntries(),
                                   /*num_ranks=*/1),
                        /*limit=*/0.0,
                        error);
  }

  // The share of the budget that is spent. Time counts only if there is a time
  // budget, because it makes a run with a schedule irreproducible.
  double Progress() const {
    double progress = static_cast<double>(summary_->num_steps()) /
                      std::max(options_.max_num_iterations, 1);
    if (options_.max_time_in_seconds < MinimizerOptions().max_time_in_seconds) {
      progress = std::max(
          progress,
          Seconds(Clock::now() - start_) / options_.max_time_in_seconds);
    }
    return std::min(progress, 1.0);
  }

  bool Step() {
    iteration_start_ = Clock::now();
    at_x_.progress = Progress();
    const double cost = at_x_.cost;
    std::string error;
    if (!Move(&error)) {
      objective_->SetState(state_);
      return Terminate(
          ceres::FAILURE,
          fmt::format("iteration {}: {}", summary_->num_steps() + 1, error));
    }
    const Eigen::VectorXd previous = state_;
    state_ = objective_->State();

    ceres::IterationSummary iteration;
    iteration.iteration = summary_->num_steps() + 1;
    iteration.cost_change = cost - at_x_.cost;
    iteration.step_norm = (state_ - previous).norm();
    iteration.step_is_successful = !was_undone_;
    if (!Record(&iteration)) return false;
    if (was_undone_) return true;
    if (iteration.step_norm == 0.0 && num_trials_ > 0 && !has_finite_trial_) {
      return Terminate(
          ceres::NO_CONVERGENCE,
          fmt::format("The rule has found no step: the cost is not finite at "
                      "any trial. Number of trials: {}",
                      num_trials_));
    }
    const double function_tolerance = options_.function_tolerance;
    if (function_tolerance > 0.0 &&
        std::abs(iteration.cost_change) <= function_tolerance * cost) {
      return Terminate(
          ceres::CONVERGENCE,
          fmt::format(
              "Function tolerance reached. |cost_change|: {:e} <= {:e} cost",
              std::abs(iteration.cost_change),
              function_tolerance));
    }
    const double tolerance = options_.parameter_tolerance;
    if (tolerance > 0.0 &&
        iteration.step_norm <= tolerance * (previous.norm() + tolerance)) {
      return Terminate(ceres::CONVERGENCE,
                       fmt::format("Parameter tolerance reached. |step|: {:e} "
                                   "<= {:e} (|x| + tolerance)",
                                   iteration.step_norm,
                                   tolerance));
    }
    return true;
  }

  // Takes the step and linearizes at the new point, or at the old one if the
  // rule undoes the step.
  bool Move(std::string* error) {
    Eigen::VectorXd step;
    num_trials_ = 0;
    has_finite_trial_ = false;
    const auto trial = [this, after = AfterOf(objective_)](auto&&... parts) {
      const bool is_finite = after(parts...);
      ++num_trials_;
      has_finite_trial_ = has_finite_trial_ || is_finite;
      return is_finite;
    };
    AddProductsAndTrials(parts_, objective_->State(), trial, &at_x_);
    if (!rule_->ComputeStep(at_x_, &step, error)) return false;
    CHECK_EQ(step.size(), objective_->num_parameters());
    if (!step.allFinite()) {
      *error = "the step is not finite";
      return false;
    }
    was_undone_ = false;
    if (judge_ == nullptr) {
      at_x_.hessian_times = nullptr;  // of the last x
      return Plus(step, error) && objective_->Linearize(parts_, &at_x_, error);
    }
    Linearization after;
    const bool is_finite =
        Plus(step, error) && objective_->Linearize(parts_, &after, error);
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    was_undone_ = !judge_->KeepsStep(is_finite ? after.cost : kNone, 1.0);
    if (was_undone_) {
      objective_->SetState(state_);
      ++summary_->num_undone;
    } else if (is_finite) {
      at_x_ = std::move(after);
    }
    return is_finite || was_undone_;
  }

  bool Plus(const Eigen::VectorXd& step, std::string* error) {
    if (objective_->Plus(step)) return true;
    *error = "the point cannot be moved by the step";
    return false;
  }

  // Completes and appends the summary of an iteration, and calls the callbacks.
  // Returns false if a callback ends the run.
  bool Record(ceres::IterationSummary* iteration) {
    iteration->step_is_valid = true;
    iteration->step_is_nonmonotonic = iteration->cost_change < 0.0;
    iteration->cost = at_x_.cost + fixed_cost_;
    iteration->gradient_norm = at_x_.gradient.norm();
    iteration->gradient_max_norm = at_x_.gradient.lpNorm<Eigen::Infinity>();
    const Clock::time_point now = Clock::now();
    iteration->iteration_time_in_seconds = Seconds(now - iteration_start_);
    iteration->cumulative_time_in_seconds = Seconds(now - start_);
    summary_->iterations.push_back(*iteration);
    summary_->final_cost = iteration->cost;
    for (ceres::IterationCallback* callback : options_.callbacks) {
      switch ((*callback)(*iteration)) {
        case ceres::SOLVER_CONTINUE:
          break;
        case ceres::SOLVER_ABORT:
          return Terminate(ceres::USER_FAILURE,
                           "User callback returned abort.");
        case ceres::SOLVER_TERMINATE_SUCCESSFULLY:
          return Terminate(ceres::USER_SUCCESS,
                           "User callback returned success.");
      }
    }
    return true;
  }

  // Returns false: the run ends.
  bool Terminate(ceres::TerminationType type, const std::string& message) {
    summary_->termination_type = type;
    summary_->message = message;
    if (summary_->num_undone > 0) {
      summary_->message +=
          fmt::format("; {} steps undone", summary_->num_undone);
    }
    summary_->total_time_in_seconds = Seconds(Clock::now() - start_);
    return false;
  }

  const MinimizerOptions& options_;
  UpdateRule* rule_;
  StepJudge* judge_;  // of the rule; may be null
  Objective* objective_;
  const double fixed_cost_;
  MinimizerSummary* summary_;
  LinearizationParts parts_;
  Linearization at_x_;
  Eigen::VectorXd state_;    // the last state with a finite linearization
  bool was_undone_ = false;  // the last step
  // Of the last step.
  int num_trials_ = 0;
  bool has_finite_trial_ = false;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point iteration_start_ = start_;
};

}  // namespace

std::string MinimizerSummary::BriefReport() const {
  return fmt::format("{}, {} steps, cost {:.6e} -> {:.6e}: {}",
                     ceres::TerminationTypeToString(termination_type),
                     num_steps(),
                     initial_cost,
                     final_cost,
                     message);
}

void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              Objective* objective,
              MinimizerSummary* summary) {
  CHECK(rule != nullptr);
  CHECK(objective != nullptr);
  CHECK(summary != nullptr);
  *summary = MinimizerSummary();
  Run(options, rule, objective, /*fixed_cost=*/0.0, summary).Minimize();
}

void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              ceres::Problem* problem,
              MinimizerSummary* summary) {
  CHECK(rule != nullptr);
  CHECK(problem != nullptr);
  CHECK(summary != nullptr);
  *summary = MinimizerSummary();
  ProblemLinearizer linearizer(problem,
                               {options.residual_blocks,
                                /*apply_loss_function=*/true,
                                options.evaluation_callback,
                                /*leave_out_fixed=*/true});
  std::string error;
  double fixed_cost = 0.0;
  if (!IsWithoutBounds(*problem, linearizer.structure(), &error) ||
      !FixedCost(*problem, linearizer.structure(), &fixed_cost, &error)) {
    summary->message = "no start: " + error;
    return;
  }
  Run(options, rule, &linearizer, fixed_cost, summary).Minimize();
  AddDoubt(options, *problem, linearizer, summary);
}

}  // namespace invgrad
