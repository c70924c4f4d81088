#include "invgrad/ceres/copy_problem.h"

#include <unordered_map>
#include <vector>

#include "ceres/cost_function.h"
#include "ceres/loss_function.h"

namespace invgrad {

ceres::Problem::Options CopyOptions(ceres::EvaluationCallback* callback) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  options.evaluation_callback = callback;
  return options;
}

// The getters of a problem return pointers to const; the setters take pointers
// to non-const.
void CopyParameterBlock(const ceres::Problem& problem,
                        double* values,
                        const ceres::Manifold* manifold,
                        ceres::Problem* copy) {
  const int size = problem.ParameterBlockSize(values);
  copy->AddParameterBlock(values, size, const_cast<ceres::Manifold*>(manifold));
  if (problem.IsParameterBlockConstant(values)) {
    copy->SetParameterBlockConstant(values);
  }
  for (int i = 0; i < size; ++i) {
    // These have no effect without a bound.
    copy->SetParameterLowerBound(
        values, i, problem.GetParameterLowerBound(values, i));
    copy->SetParameterUpperBound(
        values, i, problem.GetParameterUpperBound(values, i));
  }
}

ceres::Problem CopyProblem(const ceres::Problem& problem,
                           const ProblemStructure& structure,
                           ceres::EvaluationCallback* callback) {
  ceres::Problem copy(CopyOptions(callback));
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId id : ids) {
    problem.GetParameterBlocksForResidualBlock(id, &blocks);
    copy.AddResidualBlock(const_cast<ceres::CostFunction*>(
                              problem.GetCostFunctionForResidualBlock(id)),
                          const_cast<ceres::LossFunction*>(
                              problem.GetLossFunctionForResidualBlock(id)),
                          blocks);
  }
  // Blocks that are constant need none.
  std::unordered_map<const double*, const ceres::Manifold*> manifolds;
  for (const auto& block : structure.parameter_blocks) {
    manifolds[block.values] = block.manifold;
  }
  problem.GetParameterBlocks(&blocks);
  for (double* values : blocks) {
    CopyParameterBlock(problem, values, manifolds[values], &copy);
  }
  return copy;
}

ceres::Solver::Options UnwatchedOptions(ceres::Solver::Options options) {
  options.callbacks.clear();
  options.minimizer_progress_to_stdout = false;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = false;
  options.trust_region_minimizer_iterations_to_dump.clear();
  return options;
}

}  // namespace invgrad
