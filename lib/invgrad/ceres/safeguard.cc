#include "invgrad/ceres/safeguard.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/predicted_decrease.h"
#include "invgrad/internal/model_decrease.h"

namespace invgrad {
namespace {

// The residual blocks that a solve can change; `copy` has those of `structure`.
ceres::Problem::EvaluateOptions VariableBlocks(
    const ceres::Problem& copy, const ProblemStructure& structure) {
  std::vector<ceres::ResidualBlockId> ids;
  copy.GetResidualBlocks(&ids);
  ceres::Problem::EvaluateOptions options;
  for (const auto& block : structure.residual_blocks) {
    if (block.row_length > 0) {
      options.residual_blocks.push_back(ids[block.index]);
    }
  }
  return options;
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
                     bool has_bounds,
                     ceres::Solver::Options* options,
                     ceres::EvaluationCallback* evaluation_callback,
                     const ceres::Problem* problem,
                     ProblemLinearizer* linearizer,
                     WorkLimit* work)
    : compares_(compares),
      has_bounds_(has_bounds),
      options_(TakeTolerances(options)),
      evaluation_callback_(evaluation_callback),
      problem_(*problem),
      linearizer_(*linearizer),
      work_(*work) {}

void Safeguard::Observe(const ceres::IterationSummary& iteration,
                        const Eigen::VectorXd& state,
                        bool is_own) {
  // Moves may be rejected until the trust region is smaller.
  constexpr int kNumMoves = 3;
  constexpr double kLate = 0.75;
  // The gradient falls so much faster than the cost where the run converges. If
  // it becomes exactly zero, the run ends before it can move.
  constexpr double kSettles = 100.0;
  seconds_ = iteration.cumulative_time_in_seconds;
  const bool meets_gradient_tolerance =
      is_own && MeetsGradientTolerance(iteration);
  const bool meets_step_tolerance = is_own && MeetsStepTolerance(iteration);
  if (iteration.iteration == 0) {
    start_ = state;
    start_cost_ = iteration.cost;
  } else {
    work_.CountIteration();
    if (!is_own) has_proposals_ = true;
  }
  bool settles = false;
  if (iteration.iteration == 0 || iteration.step_is_successful) {
    settles = iteration.iteration > 0 &&
              gradient_max_norm_ * iteration.cost >
                  kSettles * iteration.gradient_max_norm * cost_;
    cost_ = iteration.cost;
    is_at_start_ = iteration.iteration == 0;
    norm_ = state.norm();
    gradient_max_norm_ = iteration.gradient_max_norm;
  }
  if (meets_gradient_tolerance) {
    predicted_decrease_ =
        HasVanished(cost_, start_cost_) ? 0.0 : PredictedDecreaseHere();
  }
  has_converged_ =
      meets_gradient_tolerance || (meets_step_tolerance && !Doubts());
  is_late_ = settles || IsFlat(iteration) ||
             iteration.iteration + kNumMoves >= options_.max_num_iterations ||
             seconds_ >= kLate * options_.max_solver_time_in_seconds;
}

Safeguard::Verdict Safeguard::verdict() const {
  if (IsPlainBetterThan(cost_) &&
      (has_converged_ || is_late_ || !work_.AllowsIteration() ||
       (!has_proposals_ && !work_.AllowsStep()))) {
    return Verdict::kPlainIsBetter;
  }
  return has_converged_ ? Verdict::kConverged : Verdict::kContinue;
}

bool Safeguard::MeetsGradientTolerance(
    const ceres::IterationSummary& iteration) const {
  if (!iteration.step_is_valid) {
    return gradient_max_norm_ <= options_.gradient_tolerance ||
           TangentGradientMaxNorm() <= options_.gradient_tolerance;
  }
  const bool is_accepted =
      iteration.iteration == 0 || iteration.step_is_successful;
  return is_accepted &&
         iteration.gradient_max_norm <= options_.gradient_tolerance;
}

bool Safeguard::MeetsStepTolerance(
    const ceres::IterationSummary& iteration) const {
  if (!iteration.step_is_valid || iteration.iteration == 0) return false;
  // Ceres applies the parameter tolerance only after an accepted step.
  const bool is_short =
      !is_at_start_ &&
      iteration.step_norm <=
          options_.parameter_tolerance * (norm_ + options_.parameter_tolerance);
  return is_short ||
         std::abs(iteration.cost_change) <= options_.function_tolerance * cost_;
}

bool Safeguard::Doubts() {
  constexpr int kMaxNumDoubts = 30;
  predicted_decrease_ = PredictedDecreaseHere();
  if (predicted_decrease_ == 0.0) return false;
  if (num_doubts_ == 0 ||
      cost_ < (1.0 - options_.function_tolerance) * cost_at_doubt_) {
    num_doubts_ = 0;
    cost_at_doubt_ = cost_;
  }
  return ++num_doubts_ <= kMaxNumDoubts;
}

// Ceres' gradient is x - Plus(x, -gradient), which a Plus that wraps angles
// makes 2 pi at the seam.
double Safeguard::TangentGradientMaxNorm() const {
  Linearization at_x;
  std::string ignored;
  if (!linearizer_.Linearize(LinearizationParts::Gradient(), &at_x, &ignored)) {
    return std::numeric_limits<double>::infinity();
  }
  return at_x.gradient.size() > 0 ? at_x.gradient.lpNorm<Eigen::Infinity>()
                                  : 0.0;
}

// Whether the next step of Ceres may change the cost by nothing at all, which
// ends the run without a call of Observe.
bool Safeguard::IsFlat(const ceres::IterationSummary& iteration) const {
  constexpr double kFlat = 1e-6;  // Ceres' default function tolerance
  return iteration.step_is_valid &&
         std::min(std::abs(iteration.cost_change),
                  gradient_max_norm_ * (norm_ + iteration.step_norm)) <=
             std::max(options_.function_tolerance, kFlat) * cost_;
}

bool Safeguard::IsPlainBetterThan(double cost) const {
  return plain_.has_value() &&
         plain_->cost < (1.0 - options_.function_tolerance) * cost;
}

void Safeguard::Compare() {
  if (!compares_ || is_compared_) return;
  is_compared_ = true;
  ceres::Problem copy =
      CopyProblem(problem_, linearizer_.structure(), evaluation_callback_);
  ceres::Solver::Options options = UnwatchedOptions(options_);
  options.max_solver_time_in_seconds =
      0.5 * std::max(0.0, options_.max_solver_time_in_seconds - seconds_);
  const Eigen::VectorXd state = linearizer_.State();
  linearizer_.SetState(start_);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &copy, &summary);
  // final_cost may be that of a rejected step, which is not the state.
  double final_cost = std::numeric_limits<double>::infinity();
  copy.Evaluate(VariableBlocks(copy, linearizer_.structure()),
                &final_cost,
                nullptr,
                nullptr,
                nullptr);
  // Without their evaluation callback, cost functions return the values of
  // another state.
  constexpr double kCostTolerance = 1e-9;
  if (std::abs(summary.initial_cost - summary.fixed_cost - start_cost_) >
          kCostTolerance * std::abs(summary.initial_cost) ||
      !(final_cost < start_cost_)) {
    message_ =
        "no comparison: the solve without proposals does not decrease the cost "
        "(do the cost functions need an evaluation callback? Then set "
        "UpdateCallback::Options::evaluation_callback)";
  } else if (summary.IsSolutionUsable()) {
    plain_ = Plain{final_cost,
                   static_cast<int>(summary.iterations.size()) - 1,
                   static_cast<int>(std::count_if(summary.iterations.begin(),
                                                  summary.iterations.end(),
                                                  &Safeguard::IsLimited)),
                   summary.termination_type == ceres::CONVERGENCE &&
                       PredictedDecreaseHere() == 0.0,
                   linearizer_.State()};
  }
  linearizer_.SetState(state);
  work_.SetComparison(plain_ ? std::optional<int>(plain_->num_iterations)
                             : std::nullopt);
}

}  // namespace invgrad
