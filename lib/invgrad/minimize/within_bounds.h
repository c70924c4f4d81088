// Goes on where Ceres stops although a bound is active.
//
// Ceres solves for a step as if there were no bounds, and projects it onto
// them. The projected step may lower the cost by less than a tolerance far from
// the minimum. So the components that the gradient pushes against their bounds
// are held constant, and Ceres solves for the others, until these components
// are the same at the end of a solve:
//
//   held_i: x_i = lower_i and dL/dx_i > 0, or x_i = upper_i and dL/dx_i < 0
//
// Components of blocks with a manifold are not held.
//
// Cost:    one gradient, if the problem has bounds; one solve for each change
//          of the held components, within the budget of all.
// Fails:   after 10 solves the summary says NO_CONVERGENCE, with a message that
//          begins with kNoMinimumWithinBounds.
#ifndef INVGRAD_MINIMIZE_WITHIN_BOUNDS_H_
#define INVGRAD_MINIMIZE_WITHIN_BOUNDS_H_

#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/minimize.h"

namespace invgrad {

constexpr char kNoMinimumWithinBounds[] = "Not at a minimum within the bounds";

// Call it after MinimizeWithCeres with these options, which has set the
// summary; further iterations are appended. Does nothing unless that run has
// converged. Callbacks see each solve from its iteration 0.
void GoOnWithinBounds(const MinimizerOptions& options,
                      const ceres::Solver::Options& ceres_options,
                      ceres::Problem* problem,
                      MinimizerSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_WITHIN_BOUNDS_H_
