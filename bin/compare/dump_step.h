// The first step of every rule as numpy arrays, to check another implementation
// against this one.
//
//   DIR/METHOD/weights.npy    theta (n)
//   DIR/METHOD/outputs.npy    y of the batch, one row a sample (B, |y|)
//   DIR/METHOD/J.npy          dy/dtheta (m, n), the samples stacked
//   DIR/METHOD/g.npy          dL/dy (m)
//   DIR/METHOD/gradient.npy   J^T g (n)
//   DIR/METHOD/step.npy       the step (n)
#ifndef BIN_COMPARE_DUMP_STEP_H_
#define BIN_COMPARE_DUMP_STEP_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/methods/method.h"
#include "problems/problem.h"

namespace invgrad {

// Uses the first batch and `weights`. Fails for Ceres' minimizers, which have
// no step from one linearization. `batch_size`: of phases without their own.
bool DumpStep(const LearningProblem& problem,
              const std::vector<Method>& methods,
              int batch_size,
              const Eigen::VectorXd& weights,
              const std::string& directory,
              std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_DUMP_STEP_H_
