// Parts of MinimizeProblem (minimize.h): Ceres' trust regions with proposals.
#ifndef INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
#define INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "invgrad/update_callback.h"

namespace invgrad {

// Minimizes by the phase's trust region of Ceres, with the proposals of the
// function, or if it is empty of the phase's rule, if any; returns a text about
// the proposals for the summary's message.
std::string MinimizeWithProposals(
    const Phase& phase,
    const MinimizerOptions& options,
    const ceres::Solver::Options& ceres_options,
    const UpdateCallback::Options& callback_options,
    const ProposalFunction& function,
    ceres::Problem* problem,
    MinimizerSummary* summary);

// False, with *error set, if the phase has a rule that cannot propose its steps
// for this problem.
bool TakesProposals(const Phase& phase,
                    const ceres::Problem& problem,
                    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_METHOD_MINIMIZATION_H_
