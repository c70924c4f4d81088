// Minimizes a ceres::Problem, or a simulator and a loss over the simulator's
// input, by a method (methods/method.h).
//
//   half_inverse            Minimize (minimizer.h), the pure iteration
//   ceres_lm, ceres_bfgs    Ceres (ceres_minimizer.h)
//   ceres_lm+half_inverse   Ceres with an UpdateCallback (update_callback.h)
//   newton/inverse/adam     pull-backs, for a simulator and a loss
//
// Fails:   returns false, before anything runs, if the method does not apply
//          (phases, batches; for a problem pull-backs), if its rule cannot
//          propose steps for this problem (UpdateCallback::IsSupported), or if J,
//          a dense solver or BFGS needs more than the available memory.
#ifndef INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
#define INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/inverse/inverse_simulator.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/minimizer.h"
#include "invgrad/minimize/point_objective.h"

namespace invgrad {

// Whether the method applies to a problem without a chain; if not, *error gives
// the reason.
bool IsForProblems(const Method& method, std::string* error);

// `elimination_order`: the ordering for Ceres' Schur solvers; null: Ceres
// chooses.
bool MinimizeProblem(
    const Method& method,
    const MinimizerOptions& options,
    std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order,
    ceres::Problem* problem,
    MinimizerSummary* summary,
    std::string* error);

// Minimizes by the phase's trust region of Ceres, with the proposals of its
// rule, if any; returns a text about the proposals for the summary's message.
std::string MinimizeWithProposals(
    const Phase& phase,
    const MinimizerOptions& options,
    const ceres::Solver::Options& ceres_options,
    const UpdateCallback::Options& callback_options,
    ceres::Problem* problem,
    MinimizerSummary* summary);

// False, with *error set, if the phase has a rule that cannot propose its steps
// for this problem.
bool TakesProposals(const Phase& phase,
                    const ceres::Problem& problem,
                    std::string* error);

// Minimizes from the objective's current point; `path` receives the points from
// the start to the final one. `inverse`: the simulator's inverse, or null.
bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      PointObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
