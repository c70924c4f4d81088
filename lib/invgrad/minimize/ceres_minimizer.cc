#include "invgrad/minimize/ceres_minimizer.h"

#include <algorithm>
#include <optional>

#include "ceres/gradient_problem.h"
#include "ceres/gradient_problem_solver.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/domain_failure.h"
#include "invgrad/ceres/predicted_decrease.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/ceres/variable_cost.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/model_decrease.h"

namespace invgrad {
namespace {

// Sets the common fields of Solver::Options and GradientProblemSolver::Options.
template <typename CeresOptions>
void ApplyMinimizerOptions(const MinimizerOptions& options,
                           CeresOptions* ceres_options) {
  CHECK(options.residual_blocks.empty())
      << "Ceres' minimizers take the whole problem, not a mini-batch.";
  ceres_options->max_num_iterations = options.max_num_iterations;
  ceres_options->max_solver_time_in_seconds = options.max_time_in_seconds;
  ceres_options->gradient_tolerance = options.gradient_tolerance;
  ceres_options->function_tolerance = options.function_tolerance;
  ceres_options->parameter_tolerance = options.parameter_tolerance;
  ceres_options->callbacks = options.callbacks;
  ceres_options->update_state_every_iteration = !options.callbacks.empty();
  ceres_options->logging_type = ceres::SILENT;
}

// The fields of a line search have the same names in both of Ceres' structs.
ceres::GradientProblemSolver::Options LineSearchOptions(
    const ceres::Solver::Options& from) {
  ceres::GradientProblemSolver::Options to;
  to.line_search_direction_type = from.line_search_direction_type;
  to.line_search_type = from.line_search_type;
  to.nonlinear_conjugate_gradient_type = from.nonlinear_conjugate_gradient_type;
  to.max_lbfgs_rank = from.max_lbfgs_rank;
  to.use_approximate_eigenvalue_bfgs_scaling =
      from.use_approximate_eigenvalue_bfgs_scaling;
  return to;
}

template <typename CeresSummary>
void ConvertSummary(const CeresSummary& ceres_summary,
                    MinimizerSummary* summary) {
  *summary = MinimizerSummary();
  summary->termination_type = ceres_summary.termination_type;
  summary->message = ceres_summary.message;
  summary->initial_cost = ceres_summary.initial_cost;
  summary->final_cost = ceres_summary.final_cost;
  summary->iterations = ceres_summary.iterations;
  summary->total_time_in_seconds = ceres_summary.total_time_in_seconds;
  // The last cost that Ceres reports may belong to a rejected step; Ceres
  // returns the best accepted state.
  for (const ceres::IterationSummary& iteration : summary->iterations) {
    summary->num_outside_domain += IsOutsideDomain(iteration);
    if (iteration.iteration == 0) {
      summary->final_cost = iteration.cost;
    } else if (iteration.step_is_successful) {
      summary->final_cost = std::min(summary->final_cost, iteration.cost);
    }
  }
  // Ceres does not record the start if all blocks are constant.
  if (summary->iterations.empty() &&
      summary->termination_type == ceres::CONVERGENCE) {
    ceres::IterationSummary start;
    start.step_is_valid = true;
    start.step_is_successful = true;
    start.cost = ceres_summary.initial_cost;
    summary->iterations.push_back(start);
  }
}

// Notes where the first step outside the domain began.
class DomainWatch final : public ceres::IterationCallback {
 public:
  explicit DomainWatch(const ProblemStructure* structure)
      : structure_(*structure) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    if (state_.size() == 0) {
      if (IsOutsideDomain(iteration)) {
        state_ = structure_.State();
      } else {
        radius_ = iteration.trust_region_radius;
      }
    }
    return ceres::SOLVER_CONTINUE;
  }

  // Why the step leads outside, if one did.
  std::optional<DomainFailure> Explain(const MinimizerOptions& options,
                                       ceres::Solver::Options ceres_options,
                                       const ceres::Problem& problem) const {
    if (state_.size() == 0) return std::nullopt;
    const Eigen::VectorXd result = structure_.State();
    structure_.SetState(state_);
    ceres_options.initial_trust_region_radius = radius_;
    DomainFailure failure;
    const bool is_found =
        ExplainNextStep(ceres_options,
                        {options.block_name, options.evaluation_callback},
                        structure_,
                        problem,
                        &failure);
    structure_.SetState(result);
    return is_found ? std::make_optional(failure) : std::nullopt;
  }

 private:
  const ProblemStructure& structure_;
  double radius_ = 0.0;    // of the last step
  Eigen::VectorXd state_;  // empty: no step has led outside
};

}  // namespace

void AddDoubt(const MinimizerOptions& options,
              const ceres::Problem& problem,
              const ProblemLinearizer& linearizer,
              MinimizerSummary* summary) {
  if (summary->termination_type != ceres::CONVERGENCE) return;
  const ProblemStructure& structure = linearizer.structure();
  double fixed_cost = 0.0;
  std::string ignored;
  FixedCost(problem, structure, &fixed_cost, &ignored);
  if (HasVanished(summary->final_cost - fixed_cost,
                  summary->initial_cost - fixed_cost)) {
    return;
  }
  summary->message +=
      NoMinimumText(PredictedDecrease(options.function_tolerance,
                                      options.parameter_tolerance,
                                      Bounds(problem, structure).any(),
                                      linearizer));
}

void MinimizeWithCeres(const MinimizerOptions& options,
                       ceres::Solver::Options ceres_options,
                       ceres::Problem* problem,
                       MinimizerSummary* summary,
                       UpdateCallback* proposals) {
  CHECK(problem != nullptr);
  CHECK(summary != nullptr);
  ApplyMinimizerOptions(options, &ceres_options);
  const ProblemStructure structure = ReadStructure(*problem, {});
  DomainWatch watch(&structure);
  if (proposals != nullptr) {
    proposals->AddTo(&ceres_options);
  } else if (ceres_options.minimizer_type == ceres::TRUST_REGION) {
    ceres_options.callbacks.push_back(&watch);
    ceres_options.update_state_every_iteration = true;
  }
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, problem, &ceres_summary);
  ConvertSummary(ceres_summary, summary);
  if (proposals == nullptr) {
    summary->first_outside_domain =
        watch.Explain(options, ceres_options, *problem);
    if (summary->termination_type == ceres::CONVERGENCE) {
      const ProblemLinearizer linearizer(problem,
                                         {{},
                                          /*apply_loss_function=*/true,
                                          options.evaluation_callback,
                                          /*leave_out_fixed=*/true});
      AddDoubt(options, *problem, linearizer, summary);
    }
    return;
  }
  summary->proposals = proposals->summary();
  summary->num_outside_domain = summary->proposals->num_outside_domain;
  summary->first_outside_domain = summary->proposals->first_outside_domain;
  if (summary->proposals->has_converged) {
    summary->termination_type = ceres::CONVERGENCE;
  }
}

void MinimizeWithCeres(const MinimizerOptions& options,
                       const ceres::Solver::Options& ceres_options,
                       ceres::FirstOrderFunction* function,
                       Eigen::VectorXd* x,
                       MinimizerSummary* summary) {
  CHECK(function != nullptr);
  CHECK(x != nullptr);
  CHECK(summary != nullptr);
  const ceres::GradientProblem problem(function);
  CHECK_EQ(x->size(), problem.NumParameters());
  ceres::GradientProblemSolver::Options line_search =
      LineSearchOptions(ceres_options);
  ApplyMinimizerOptions(options, &line_search);
  ceres::GradientProblemSolver::Summary ceres_summary;
  ceres::Solve(line_search, problem, x->data(), &ceres_summary);
  ConvertSummary(ceres_summary, summary);
}

std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          double rows,
                                          double cols) {
  // Ours, Ceres' own, and the one from which that is assembled or in which it
  // is factorized.
  std::vector<MemoryPart> parts = {{"J", sizeof(double) * 3.0 * rows * cols}};
  if (solver != ceres::CGNR) {
    parts.push_back({"normal equations", sizeof(double) * cols * cols});
  }
  return parts;
}

}  // namespace invgrad
