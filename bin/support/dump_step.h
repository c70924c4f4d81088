// The first step of every rule as numpy arrays, so that any other
// implementation can be checked against this one.
//
//   DIR/METHOD/weights.npy    theta (n)
//   DIR/METHOD/outputs.npy    y of the batch, one row a sample (B, |y|)
//   DIR/METHOD/J.npy          dy/dtheta (m, n), the samples stacked
//   DIR/METHOD/g.npy          dL/dy (m)
//   DIR/METHOD/gradient.npy   J^T g (n)
//   DIR/METHOD/step.npy       the step (n)
#ifndef BIN_SUPPORT_DUMP_STEP_H_
#define BIN_SUPPORT_DUMP_STEP_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/learning_comparison.h"

namespace invgrad {

// On the first batch of the first seed. Ceres' own minimizers have no step of
// one linearization and are refused.
bool DumpStep(const LearningProblem& problem,
              const std::vector<Method>& methods,
              const LearningComparisonOptions& options,
              const Eigen::VectorXd& initial_weights,
              const std::string& directory,
              std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_DUMP_STEP_H_
