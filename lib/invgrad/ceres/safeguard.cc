#include "invgrad/ceres/safeguard.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <vector>

#include "ceres/cost_function.h"
#include "ceres/manifold.h"
#include "invgrad/ceres/copy_problem.h"

namespace invgrad {
namespace {

// The cost of the residual blocks that nothing can change. Ceres leaves it out
// of the cost to which it applies the function tolerance.
double FixedCost(const ceres::Problem& problem,
                 const ProblemStructure& structure) {
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  double sum = 0.0;
  for (const auto& block : structure.residual_blocks) {
    double cost = 0.0;
    if (block.row_length == 0 &&
        problem.EvaluateResidualBlock(
            ids[block.index], true, &cost, nullptr, nullptr)) {
      sum += cost;
    }
  }
  return sum;
}

ceres::Solver::Options TakeTolerances(ceres::Solver::Options* options) {
  ceres::Solver::Options users = *options;
  options->function_tolerance = 0.0;
  options->gradient_tolerance = 0.0;
  options->parameter_tolerance = 0.0;
  return users;
}

}  // namespace

Safeguard::Safeguard(bool compares,
                     ceres::Solver::Options* options,
                     const ceres::Problem* problem,
                     ProblemLinearizer* linearizer)
    : compares_(compares),
      options_(TakeTolerances(options)),
      problem_(*problem),
      linearizer_(*linearizer),
      fixed_cost_(FixedCost(*problem, linearizer->structure())) {}

Safeguard::Verdict Safeguard::Judge(const ceres::IterationSummary& iteration,
                                    const Eigen::VectorXd& state,
                                    bool is_own) {
  if (is_moving_) {
    return iteration.step_is_successful && !is_own ? Verdict::kConverged
                                                   : Verdict::kPlainIsBetter;
  }
  const bool has_converged = is_own && MeetsTolerances(iteration);
  if (iteration.iteration > 0 && !is_own) has_proposals_ = true;
  if (iteration.iteration == 0 || iteration.step_is_successful) {
    if (iteration.iteration == 0) {
      start_ = state;
      start_cost_ = iteration.cost;
    }
    cost_ = iteration.cost - fixed_cost_;
    is_at_start_ = iteration.iteration == 0;
    norm_ = state.norm();
    gradient_max_norm_ = iteration.gradient_max_norm;
  }
  if (compares_ && has_proposals_) {
    const bool is_last =
        has_converged || IsFlat(iteration) ||
        iteration.iteration + kNumFreeIterations >= options_.max_num_iterations;
    if (!is_compared_ &&
        (is_last || iteration.iteration >= kNumFreeIterations)) {
      is_compared_ = true;
      SolvePlain();
    }
    if (IsPlainBetter() &&
        (is_last || iteration.iteration >= plain_->num_iterations)) {
      is_moving_ = true;
      return Verdict::kPlainIsBetter;
    }
  }
  return has_converged ? Verdict::kConverged : Verdict::kContinue;
}

bool Safeguard::MeetsTolerances(
    const ceres::IterationSummary& iteration) const {
  if (!iteration.step_is_valid) {
    return gradient_max_norm_ <= options_.gradient_tolerance;
  }
  const bool is_accepted =
      iteration.iteration == 0 || iteration.step_is_successful;
  if (is_accepted &&
      iteration.gradient_max_norm <= options_.gradient_tolerance) {
    return true;
  }
  // Ceres applies the parameter tolerance only after an accepted step.
  const bool is_short =
      !is_at_start_ &&
      iteration.step_norm <=
          options_.parameter_tolerance * (norm_ + options_.parameter_tolerance);
  const double least_change =
      std::max(options_.function_tolerance * cost_,
               // Below it, the difference cost_ is rounding error.
               std::numeric_limits<double>::epsilon() * fixed_cost_);
  return iteration.iteration > 0 &&
         (is_short || std::abs(iteration.cost_change) <= least_change);
}

// Whether the next step of Ceres may change the cost by nothing at all, which
// ends the run before Judge.
bool Safeguard::IsFlat(const ceres::IterationSummary& iteration) const {
  constexpr double kFlat = 1e-6;  // Ceres' default function tolerance
  return iteration.step_is_valid &&
         std::min(std::abs(iteration.cost_change),
                  gradient_max_norm_ * (norm_ + iteration.step_norm)) <=
             std::max(options_.function_tolerance, kFlat) * cost_;
}

bool Safeguard::IsPlainBetter() const {
  return plain_.has_value() && plain_->cost - fixed_cost_ <
                                   (1.0 - options_.function_tolerance) * cost_;
}

void Safeguard::SolvePlain() {
  ceres::Problem copy(
      CopyOptions(ceres::DO_NOT_TAKE_OWNERSHIP, /*callback=*/nullptr));
  // The manifolds before they were wrapped.
  std::unordered_map<const double*, const ceres::Manifold*> manifolds;
  for (const auto& block : linearizer_.structure().parameter_blocks) {
    manifolds[block.values] = block.manifold;
  }
  CopyProblem(
      problem_,
      [](const ceres::CostFunction* function) {
        return const_cast<ceres::CostFunction*>(function);
      },
      [&manifolds](const double* values) {
        const auto found = manifolds.find(values);
        return found == manifolds.end() ? nullptr : found->second;
      },
      &copy);
  ceres::Solver::Options options = options_;
  options.callbacks.clear();
  options.minimizer_progress_to_stdout = false;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = false;
  options.trust_region_minimizer_iterations_to_dump.clear();
  const Eigen::VectorXd state = linearizer_.State();
  linearizer_.SetState(start_);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &copy, &summary);
  // An evaluation callback, which the copy does not have, would leave values of
  // another state.
  constexpr double kCostTolerance = 1e-9;
  if (std::abs(summary.initial_cost - start_cost_) >
      kCostTolerance * std::abs(start_cost_)) {
    message_ =
        "no comparison with the solve without proposals: the cost functions "
        "depend on more than their parameters (an evaluation callback?)";
  } else if (summary.IsSolutionUsable()) {
    plain_ = Plain{summary.final_cost,
                   static_cast<int>(summary.iterations.size()) - 1,
                   linearizer_.State()};
  }
  linearizer_.SetState(state);
}

}  // namespace invgrad
