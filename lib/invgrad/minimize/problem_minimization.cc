#include "invgrad/minimize/problem_minimization.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "ceres/types.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/methods/ceres_method.h"
#include "invgrad/train/training_memory.h"

namespace invgrad {

namespace {

double NumVariables(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  double sum = 0.0;
  for (const double* block : blocks) {
    if (!problem.IsParameterBlockConstant(block)) {
      sum += problem.ParameterBlockTangentSize(block);
    }
  }
  return sum;
}

double NumVariableResiduals(const ceres::Problem& problem) {
  std::vector<ceres::ResidualBlockId> residual_blocks;
  problem.GetResidualBlocks(&residual_blocks);
  std::vector<double*> blocks;
  double sum = 0.0;
  for (const ceres::ResidualBlockId id : residual_blocks) {
    problem.GetParameterBlocksForResidualBlock(id, &blocks);
    if (std::any_of(blocks.begin(), blocks.end(), [&](const double* block) {
          return !problem.IsParameterBlockConstant(block);
        })) {
      sum += problem.GetCostFunctionForResidualBlock(id)->num_residuals();
    }
  }
  return sum;
}

bool CeresFitsInMemory(const Method& method,
                       const ceres::Solver::Options& options,
                       const ceres::Problem& problem,
                       std::string* error) {
  // What Ceres solves for: blocks that are not constant, and residual blocks
  // that depend on one.
  const double cols = NumVariables(problem);
  const double rows = NumVariableResiduals(problem);
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
    callback = std::make_unique<UpdateCallback>(rule.get(), problem);
    with_rule.callbacks.push_back(callback->iteration_callback());
  }
  MinimizeWithCeres(with_rule, solver_options, problem, summary);
  if (callback != nullptr) {
    summary->message += ProposalsText(callback->summary());
  }
  return true;
}

}  // namespace invgrad
