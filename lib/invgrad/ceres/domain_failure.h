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
//          3 k + 1 evaluations of one. ExplainNextStep: one iteration of
//          ceres::Solve in addition.
// Fails:   returns false if there is no failure.
// Limits:  the set is the smallest one only if returning more components never
//          leads outside again. ExplainNextStep explains no steps of inner
//          iterations and of line searches, and none of blocks with more than
//          512 parameters.
#ifndef INVGRAD_CERES_DOMAIN_FAILURE_H_
#define INVGRAD_CERES_DOMAIN_FAILURE_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

struct DomainFailure {
  enum class Reason {
    kPlus,      // a Plus returned false
    kReturned,  // a cost function returned false
    kResidual,  // not finite
    kCost,      // 1/2 rho(|r|^2) is not finite, r is
    kJacobian,  // not finite
  };

  struct Options {
    // The name of a block; "" or no function: "block i", as in a RankReport.
    std::function<std::string(const double* values)> block_name;
    // The evaluation callback of the problem, if any. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
  };

  struct Parameter {
    int block = 0;       // of ProblemStructure::parameter_blocks
    std::string name;    // of the block
    int component = -1;  // -1: the whole block
    // Of the component; of a whole block, the norms.
    double value = 0.0;  // at the bad state
    double was = 0.0;    // at the good state
  };

  Reason reason = Reason::kReturned;
  int residual_block = -1;  // its index in the problem; -1: kPlus
  // Outside at the bad state; kPlus: parameter blocks whose Plus fails.
  int num_failing_blocks = 0;
  // The good state lies outside, too, and no parameter explains it.
  bool fails_at_good_state = false;
  // Only without Jacobians, as for cost functions that return false for
  // jacobians = nullptr.
  bool only_without_jacobians = false;
  std::vector<Parameter> parameters;

  // As above; after 5 parameters the rest is a count.
  std::string ToText() const;
};

// Whether Ceres' candidate of this iteration lies outside the domain.
bool IsOutsideDomain(const ceres::IterationSummary& iteration);

// Compares two states. The blocks of the problem change during the call only.
// The problem has the `structure`.
bool ExplainDomainFailure(const DomainFailure::Options& options,
                          const ProblemStructure& structure,
                          const Eigen::VectorXd& good_state,
                          const Eigen::VectorXd& bad_state,
                          DomainFailure* failure);

// Explains the failure of Plus(current values, step).
bool ExplainFailingStep(const DomainFailure::Options& options,
                        const ProblemStructure& structure,
                        const Eigen::VectorXd& step,
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
