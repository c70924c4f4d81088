// Minimizes a ceres::Problem by a method (method.h).
//
//   half_inverse            Minimize (minimizer.h), the pure iteration
//   ceres_lm, ceres_bfgs    Ceres (ceres_minimizer.h)
//   ceres_lm+half_inverse   Ceres with an UpdateCallback (update_callback.h)
//
// Fails:   returns false, before anything runs, if the method is not for a
//          problem without a chain (phases, pull-backs, batches), if its rule
//          cannot propose steps for this problem (UpdateCallback::IsSupported),
//          or if a dense solver or BFGS needs more than the available memory.
#ifndef INVGRAD_MINIMIZE_PROBLEM_MINIMIZATION_H_
#define INVGRAD_MINIMIZE_PROBLEM_MINIMIZATION_H_

#include <memory>
#include <string>

#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/minimizer.h"

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

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_PROBLEM_MINIMIZATION_H_
