// Minimizes a ceres::Problem by the steps of an update rule, taken as they are.
//
//   x_{k+1} = Plus(x_k, rule(linearization at x_k))
//
// This is the pure iteration: no line search, no accept or reject; for a
// safeguarded one see update_callback.h. Options, summary and termination use
// Ceres' own types, so that a run of ceres::Solve stands in the same table
// (ceres_minimizer.h).
//
// Cost:    one linearization and one step an iteration.
// Fails:   a numerical failure (no finite step; cost, gradient or Jacobian not
//          finite) ends the run with ceres::FAILURE and a message that names
//          the iteration; the blocks are left at the last state where all of
//          them were finite, and the step that failed is not recorded.
#ifndef INVGRAD_MINIMIZE_MINIMIZER_H_
#define INVGRAD_MINIMIZE_MINIMIZER_H_

#include <string>
#include <vector>

#include "ceres/evaluation_callback.h"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/types.h"
#include "invgrad/core/objective.h"
#include "invgrad/core/update_rule.h"

namespace invgrad {

struct MinimizerOptions {
  int max_num_iterations = 50;
  double max_time_in_seconds = 1e9;
  //  max_i |gradient_i| <= gradient_tolerance, in the tangent space
  double gradient_tolerance = 1e-10;
  //  |L_{k+1} - L_k| <= function_tolerance L_k; 0 switches it off
  double function_tolerance = 1e-6;
  //  |x_{k+1} - x_k| <= parameter_tolerance (|x_k| + parameter_tolerance);
  // 0 switches it off
  double parameter_tolerance = 1e-8;
  // A mini-batch. Empty: all of the problem's residual blocks.
  std::vector<ceres::ResidualBlockId> residual_blocks;
  // Called at x_0 and after every step, with the blocks up to date. Not owned.
  // SOLVER_ABORT ends the run with USER_FAILURE, SOLVER_TERMINATE_SUCCESSFULLY
  // with USER_SUCCESS; the blocks stay where they are.
  std::vector<ceres::IterationCallback*> callbacks;
  // The problem's own, if it has one (see ProblemLinearizer). Not owned.
  ceres::EvaluationCallback* evaluation_callback = nullptr;
};

struct MinimizerSummary {
  ceres::TerminationType termination_type = ceres::FAILURE;
  std::string message;
  double initial_cost = -1.0;
  double final_cost = -1.0;
  // [0] is the start. Minimize fills cost, cost_change, the norms of gradient
  // (tangent space) and step (ambient), the flags (nonmonotonic: the cost rose;
  // successful: the rule did not take the step back) and the times.
  std::vector<ceres::IterationSummary> iterations;
  double total_time_in_seconds = 0.0;
  int num_taken_back = 0;  // steps, by a rule that judges them

  int num_steps() const {
    return iterations.empty() ? 0 : static_cast<int>(iterations.size()) - 1;
  }
  // "CONVERGENCE, 12 steps, cost 4.5e+01 -> 1.2e-12: ..."
  std::string BriefReport() const;
};

void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              ceres::Problem* problem,
              MinimizerSummary* summary);

// The same for any objective; the options that name parts of a ceres::Problem
// are not read.
void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              Objective* objective,
              MinimizerSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_MINIMIZER_H_
