#include "invgrad/solve/problem_minimization.h"

#include <utility>
#include <vector>

#include "ceres/types.h"
#include "invgrad/solve/ceres_method.h"
#include "invgrad/solve/training_memory.h"
#include "invgrad/solve/update_callback.h"

namespace invgrad {

namespace {

bool IsForProblems(const Method& method, std::string* error) {
  if (!method.earlier.empty()) {
    *error = "a method in phases needs a network to train";
  } else if (method.pull_back.has_value()) {
    *error = "nothing can be pulled back part by part: there is no chain";
  } else if (method.batch_size >= 0) {
    *error = "batch_size needs a network to train";
  } else {
    return true;
  }
  return false;
}

bool CeresFitsInMemory(const Method& method,
                       const ceres::Solver::Options& options,
                       const ceres::Problem& problem,
                       std::string* error) {
  const double rows = problem.NumResiduals();
  const double cols = problem.NumParameters();
  std::vector<MemoryPart> parts;
  if (!method.ceres->is_trust_region) {
    if (options.line_search_direction_type != ceres::BFGS) return true;
    parts = {{"inverse Hessian", 2.0 * sizeof(double) * cols * cols}};
  } else if (options.linear_solver_type == ceres::DENSE_QR ||
             options.linear_solver_type == ceres::DENSE_NORMAL_CHOLESKY) {
    parts = TrustRegionMemory(options.linear_solver_type, rows, cols);
  }
  return FitsInMemory(method.label, std::move(parts), /*limit=*/0.0, error);
}

}  // namespace

bool MinimizeProblem(
    const Method& method,
    const MinimizerOptions& options,
    std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order,
    ceres::Problem* problem,
    MinimizerSummary* summary,
    std::string* error) {
  if (!IsForProblems(method, error)) return false;
  const std::unique_ptr<UpdateRule> rule = method.MakeRule();
  if (method.ceres == nullptr) {
    Minimize(options, rule.get(), problem, summary);
    return true;
  }
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options unused;
  ConfigureCeres(method, &solver_options, &unused);
  if (!CeresFitsInMemory(method, solver_options, *problem, error) ||
      !TakesProposals(method, *problem, error)) {
    return false;
  }
  if (ceres::IsSchurType(solver_options.linear_solver_type)) {
    solver_options.linear_solver_ordering = std::move(elimination_order);
  }
  MinimizerOptions with_rule = options;
  std::unique_ptr<UpdateCallback> callback;
  if (rule != nullptr) {
    callback = std::make_unique<UpdateCallback>(
        UpdateCallback::Options(), rule.get(), problem);
    with_rule.callbacks.push_back(callback.get());
  }
  MinimizeWithCeres(with_rule, solver_options, problem, summary);
  if (callback != nullptr) {
    summary->message += ProposalsText(callback->summary());
  }
  return true;
}

}  // namespace invgrad
