// Names the residual block and the parameters because of which a state lies
// outside the domain of a ceres::Problem.
//
//   outside:  a Plus or a cost function returns false, or r, rho(|r|^2) or J is
//             not finite; r = 1e308 is, but |r|^2 is not
//
// Reported is the first such residual block, and the fewest parameters that
// explain it: with their values of the last good state in the place of those of
// the bad one, the residual block can be evaluated. This is one component if one
// suffices, preferably one whose change alone leads outside. Otherwise
// components return to their good values all at once, and each that is not
// needed for that takes its bad value again. A block with a manifold is one
// parameter, because its components do not vary alone, except for a
// SubsetManifold.
//
//   r = log(b0 + b1 t):  "residual block 12 (cost function returned false):
//                         parameter `b`[1] = -0.31 (was 400)"
//
// Shapes:  states as of ProblemLinearizer::State, steps in its tangent columns.
// Cost:    all residual blocks at the bad state; then, for k components, at most
//          3 k + 1 evaluations of one. ExplainInvalidStart: at most 400 of
//          these more. ExplainNextStep: one iteration of ceres::Solve in
//          addition.
// Fails:   returns false if there is no failure.
// Limits:  the set is the smallest one only if returning more components never
//          leads outside again. ExplainNextStep explains no steps of inner
//          iterations and of line searches, and none of blocks with more than
//          512 parameters.
#ifndef INVGRAD_CERES_DOMAIN_FAILURE_H_
#define INVGRAD_CERES_DOMAIN_FAILURE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/update_callback.h"

namespace invgrad {

// Whether Ceres' candidate of this iteration lies outside the domain.
bool IsOutsideDomain(const ceres::IterationSummary& iteration);

// Compares two states. The blocks of the problem change during the call only.
// The problem has the `structure`.
bool ExplainDomainFailure(const DomainFailure::Options& options,
                          const ProblemStructure& structure,
                          const Eigen::VectorXd& good_state,
                          const Eigen::VectorXd& bad_state,
                          DomainFailure* failure);

// Explains the failure of Plus(current values, step), projected onto the bounds.
bool ExplainFailingStep(const DomainFailure::Options& options,
                        const ProblemStructure& structure,
                        const Bounds& bounds,
                        const Eigen::VectorXd& step,
                        DomainFailure* failure);

// Explains why the problem has no value at the current values, by a parameter of
// which another value mends the residual block (internal/invalid_start.h).
// Returns false if it has one.
bool ExplainInvalidStart(const DomainFailure::Options& options,
                         const ProblemStructure& structure,
                         DomainFailure* failure);

// Explains why the first step of ceres::Solve from the current values leads
// outside: makes it again, on a copy of the problem. `structure` has the
// problem's own manifolds, if they are wrapped. Callbacks of the solver options
// are not called.
bool ExplainNextStep(const ceres::Solver::Options& solver_options,
                     const DomainFailure::Options& options,
                     const ProblemStructure& structure,
                     const ceres::Problem& problem,
                     DomainFailure* failure);

}  // namespace invgrad

#endif  // INVGRAD_CERES_DOMAIN_FAILURE_H_
