// Copies a ceres::Problem over the same parameter values.
#ifndef INVGRAD_CERES_COPY_PROBLEM_H_
#define INVGRAD_CERES_COPY_PROBLEM_H_

#include <functional>

#include "ceres/cost_function.h"
#include "ceres/evaluation_callback.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"

namespace invgrad {

// The options of a copy that owns no object of the original; `ownership`: of
// its cost functions. The original is already checked.
ceres::Problem::Options CopyOptions(ceres::Ownership ownership,
                                    ceres::EvaluationCallback* callback);

// Adds a parameter block, with its constness and bounds, and this manifold
// (null: Euclidean).
void CopyParameterBlock(const ceres::Problem& problem,
                        double* values,
                        const ceres::Manifold* manifold,
                        ceres::Problem* copy);

// Adds the residual blocks of `problem`, in their order, and its parameter
// blocks to the empty problem `copy`, with the cost functions and manifolds
// (null: Euclidean) that the functions return.
void CopyProblem(
    const ceres::Problem& problem,
    const std::function<ceres::CostFunction*(const ceres::CostFunction*)>&
        cost_function,
    const std::function<const ceres::Manifold*(const double* values)>& manifold,
    ceres::Problem* copy);

}  // namespace invgrad

#endif  // INVGRAD_CERES_COPY_PROBLEM_H_
