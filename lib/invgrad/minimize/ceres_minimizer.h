// Runs Ceres' minimizers behind the summary of Minimize (minimize.h).
//
// Differences to Minimize: iterations include rejected steps, but not a final
// step that meets a tolerance of Ceres; function and parameter tolerances of 0
// end a run when nothing changes; on SOLVER_ABORT a trust region resets the
// blocks to the start; mini-batches are not supported (CHECKed).
// Fails:   like Ceres: FAILURE in the summary with Ceres' message, also for
//          options that Ceres rejects.
#ifndef INVGRAD_MINIMIZE_CERES_MINIMIZER_H_
#define INVGRAD_MINIMIZE_CERES_MINIMIZER_H_

#include <vector>

#include "Eigen/Core"
#include "ceres/first_order_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/types.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/minimize.h"
#include "invgrad/update_callback.h"

namespace invgrad {

// Runs ceres::Solve with the given options of Ceres, except that budget,
// tolerances and callbacks come from `options`, and logging is off. Callbacks
// run in the given order, with up-to-date blocks (the best state, if steps may
// be nonmonotonic), and after them `proposals`, if it is not null. If a
// candidate lies outside the problem's domain, the first of them is computed
// again, and first_outside_domain explains it.
void MinimizeWithCeres(const MinimizerOptions& options,
                       ceres::Solver::Options ceres_options,
                       ceres::Problem* problem,
                       MinimizerSummary* summary,
                       UpdateCallback* proposals = nullptr);

// The same for a smooth function, by the line search, its direction and the
// options of the direction in `ceres_options`. Takes ownership of `function`,
// as ceres::GradientProblem does.
void MinimizeWithCeres(const MinimizerOptions& options,
                       const ceres::Solver::Options& ceres_options,
                       ceres::FirstOrderFunction* function,
                       Eigen::VectorXd* x,
                       MinimizerSummary* summary);

// After convergence, says in the message if the state is no minimum
// (predicted_decrease.h). The linearizer leaves out the problem's fixed cost.
void AddDoubt(const MinimizerOptions& options,
              const ceres::Problem& problem,
              const ProblemLinearizer& linearizer,
              MinimizerSummary* summary);

// The memory of a trust region with an m x n Jacobian: its copies in the linear
// solver, 8 m n bytes each, and the normal equations, 8 n^2.
std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          double rows,
                                          double cols);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_CERES_MINIMIZER_H_
