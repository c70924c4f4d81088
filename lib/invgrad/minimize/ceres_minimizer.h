// Runs Ceres' minimizers behind the summary of Minimize (minimizer.h).
//
// Differences to Minimize: iterations hold the rejected steps too; a step on
// which Ceres ends the run by a tolerance is not among them; function and
// parameter tolerances of 0 end a run on no change at all; on SOLVER_ABORT a
// trust region puts the blocks back to the start; mini-batches are refused
// (CHECKed).
// Fails:   as Ceres: FAILURE in the summary with Ceres' message, also for
//          options that Ceres refuses.
#ifndef INVGRAD_MINIMIZE_CERES_MINIMIZER_H_
#define INVGRAD_MINIMIZE_CERES_MINIMIZER_H_

#include "Eigen/Core"
#include "ceres/first_order_function.h"
#include "ceres/gradient_problem_solver.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/minimize/minimizer.h"

namespace invgrad {

// Runs ceres::Solve with Ceres' options as given, but for the budget,
// tolerances and callbacks, which come from `options`, and its log, which is
// silent. Callbacks run in the order given, an UpdateCallback among them, and
// see the blocks up to date (the best state, if steps may be nonmonotonic).
void MinimizeWithCeres(const MinimizerOptions& options,
                       ceres::Solver::Options ceres_options,
                       ceres::Problem* problem,
                       MinimizerSummary* summary);

// The same for a smooth function (line searches only). Takes ownership of
// `function`, as ceres::GradientProblem does.
void MinimizeWithCeres(const MinimizerOptions& options,
                       ceres::GradientProblemSolver::Options ceres_options,
                       ceres::FirstOrderFunction* function,
                       Eigen::VectorXd* x,
                       MinimizerSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_CERES_MINIMIZER_H_
