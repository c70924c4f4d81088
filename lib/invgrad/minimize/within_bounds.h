// Goes on where Ceres stops although a bound is active.
//
// Ceres solves for a step as if there were no bounds, and projects it onto
// them. The projected step may lower the cost by less than a tolerance far from
// the minimum. So, after each solve, the components that a bound stops take a
// step of their own,
//
//   x_i(t) = P(x_i - t g_i / d_i),   g = dL/dx,   d_i = (J^T J)_ii
//
// with the first t = 1, 1/2, 1/4, ... that does not raise the cost. A bound
// stops x_i if x_i(1) is on it. Those that are then at their bounds, and that g
// pushes outwards, are held constant, and Ceres solves for the others, until
// such a solve with the same components lowers the cost by less than the function
// tolerance.
//
// Components of blocks with a manifold are not held.
//
// Source:  J. More, G. Toraldo, "On the solution of large quadratic programming
//          problems with bound constraints", SIAM J. Optim. 1 (1991): gradient
//          projection and a solve on the face, in turns.
// Cost:    one Jacobian, if the problem has bounds; then for each solve a
//          Jacobian and some costs, within the budget of all.
// Fails:   the summary says NO_CONVERGENCE, with a message that begins with
//          kNoMinimumWithinBounds, if the same components are held again at no
//          lower cost. Without MinimizerOptions::evaluation_callback, cost
//          functions that need one do not move, which is not noticed.
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
