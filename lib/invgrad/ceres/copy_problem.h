// Copies a ceres::Problem over the same parameter values, to solve it again.
#ifndef INVGRAD_CERES_COPY_PROBLEM_H_
#define INVGRAD_CERES_COPY_PROBLEM_H_

#include "ceres/evaluation_callback.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

// The options of a copy that owns no object of the original. The original is
// already checked.
ceres::Problem::Options CopyOptions(ceres::EvaluationCallback* callback);

// Adds a parameter block, with its constness and bounds, and this manifold
// (null: Euclidean).
void CopyParameterBlock(const ceres::Problem& problem,
                        double* values,
                        const ceres::Manifold* manifold,
                        ceres::Problem* copy);

// A copy with the residual blocks of `problem`, in their order, and the
// manifolds of `structure`, which the problem had before they were wrapped.
ceres::Problem CopyProblem(const ceres::Problem& problem,
                           const ProblemStructure& structure,
                           ceres::EvaluationCallback* callback);

// The options for a solve that nobody watches: no callbacks, no output.
ceres::Solver::Options UnwatchedOptions(ceres::Solver::Options options);

}  // namespace invgrad

#endif  // INVGRAD_CERES_COPY_PROBLEM_H_
