#include "invgrad/ceres/copy_problem.h"

#include <vector>

#include "ceres/loss_function.h"

namespace invgrad {

ceres::Problem::Options CopyOptions(ceres::Ownership ownership,
                                    ceres::EvaluationCallback* callback) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ownership;
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

void CopyProblem(
    const ceres::Problem& problem,
    const std::function<ceres::CostFunction*(const ceres::CostFunction*)>&
        cost_function,
    const std::function<const ceres::Manifold*(const double* values)>& manifold,
    ceres::Problem* copy) {
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId id : ids) {
    problem.GetParameterBlocksForResidualBlock(id, &blocks);
    copy->AddResidualBlock(
        cost_function(problem.GetCostFunctionForResidualBlock(id)),
        const_cast<ceres::LossFunction*>(
            problem.GetLossFunctionForResidualBlock(id)),
        blocks);
  }
  problem.GetParameterBlocks(&blocks);
  for (double* values : blocks) {
    CopyParameterBlock(problem, values, manifold(values), copy);
  }
}

}  // namespace invgrad
