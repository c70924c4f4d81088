// Ceres' own minimizers behind the same summary as Minimize, for baselines.
//
//   name                     Ceres
//   ceres_lm                 trust region, Levenberg-Marquardt
//   ceres_dogleg             trust region, dogleg
//   ceres_bfgs               line search, BFGS
//   ceres_lbfgs              line search, L-BFGS
//   ceres_nonlinear_cg       line search, nonlinear conjugate gradients
//   ceres_steepest_descent   line search, steepest descent
//
// The trust-region methods need a least-squares problem; the line searches also
// take a ceres::FirstOrderFunction (ceres::GradientProblem), which is how a
// model is given to them: one backward pass instead of a Jacobian.
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

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/first_order_function.h"
#include "ceres/gradient_problem_solver.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/minimize/minimizer.h"
#include "invgrad/rules/rules.h"

namespace invgrad {

struct CeresMethodRow {
  std::string name;
  std::string formula;  // one line
  bool is_trust_region;
  std::function<std::vector<OptionSet::Row>()> options;
  // Applies the settings; false with *error set if one is unknown or out of
  // range. `gradient_options` is untouched by trust-region rows.
  std::function<bool(const Settings& settings,
                     ceres::Solver::Options* options,
                     ceres::GradientProblemSolver::Options* gradient_options,
                     std::string* error)>
      configure;
};

const std::vector<CeresMethodRow>& CeresMethods();
const CeresMethodRow* FindCeresMethod(const std::string& name);

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
