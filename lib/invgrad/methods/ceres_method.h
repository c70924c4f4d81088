// What training and minimizing by a method with Ceres (method.h) share.
#ifndef INVGRAD_METHODS_CERES_METHOD_H_
#define INVGRAD_METHODS_CERES_METHOD_H_

#include <string>

#include "ceres/gradient_problem_solver.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/methods/method.h"

namespace invgrad {

constexpr char kNeedsLeastSquares[] =
    "a trust region needs a least-squares loss, c |y - y*|^2";

// Ceres' options by the settings of the method, which were checked when it was
// parsed.
void ConfigureCeres(const Method& method,
                    ceres::Solver::Options* options,
                    ceres::GradientProblemSolver::Options* gradient_options);

// False, with *error set, if the method has a rule that cannot propose its
// steps for this problem.
bool TakesProposals(const Method& method,
                    const ceres::Problem& problem,
                    std::string* error);

// What is added to a run's message; if all was left to Ceres, also why.
std::string ProposalsText(const UpdateCallback::Summary& summary);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_CERES_METHOD_H_
