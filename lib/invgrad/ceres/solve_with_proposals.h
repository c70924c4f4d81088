// One ceres::Solve with proposals (update_callback.h): whose turn
// it is, what replaces Ceres' next step, and when the run ends.
#ifndef INVGRAD_CERES_SOLVE_WITH_PROPOSALS_H_
#define INVGRAD_CERES_SOLVE_WITH_PROPOSALS_H_

#include <string>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/domain_failure.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/proposal.h"
#include "invgrad/ceres/safeguard.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/ceres/turn_taking.h"
#include "invgrad/ceres/variable_cost.h"
#include "invgrad/ceres/work_limit.h"
#include "invgrad/update_callback.h"
#include "invgrad/update_rule.h"

namespace invgrad {

class SolveWithProposals {
 public:
  // Sets the tolerances of the solver options to zero (safeguard.h) and, if there
  // are bounds, switches the line search off. Keeps all other pointers.
  SolveWithProposals(const UpdateCallback::Options& options,
                     const WorkLimit& work,
                     const Proposer& proposer,
                     const Bounds* bounds,
                     const ceres::Problem* problem,
                     ProblemLinearizer* linearizer,
                     StagedStep* staged,
                     ceres::Solver::Options* solver_options);
  SolveWithProposals(const SolveWithProposals&) = delete;
  SolveWithProposals& operator=(const SolveWithProposals&) = delete;

  // Call after each iteration, the 0th included.
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration);

  UpdateCallback::Summary summary() const;

 private:
  // What replaces the next step of Ceres.
  enum class Next {
    kCeresStep,  // nothing
    kProposal,
    kPlainState,  // the result of the solve without proposals
    kSameState,   // a step of length zero, which ends the run
  };

  // From here on, costs are those without the fixed cost.
  ceres::CallbackReturnType PrepareNext(
      const ceres::IterationSummary& iteration);
  bool Conclude();
  ceres::CallbackReturnType Restage(bool was_passed_over);
  ceres::CallbackReturnType Continue(const ceres::IterationSummary& iteration,
                                     Next made,
                                     bool was_passed_over);
  void Count(const ceres::IterationSummary& iteration, Next made);
  ceres::CallbackReturnType Propose(bool is_rules_turn);
  DomainFailure::Options FailureOptions() const;
  void ExplainCeresStep(double radius);
  void ExplainProposal();
  bool HasWorkLeft(bool has_work_left);
  void Stage(Next next);
  ceres::CallbackReturnType Abort(const std::string& message);

  const UpdateCallback::Options options_;
  const ceres::Solver::Options solver_options_;
  const ceres::Problem& problem_;
  ProblemLinearizer& linearizer_;
  StagedStep& staged_;
  VariableCost variable_cost_;
  WorkLimit work_;
  Safeguard safeguard_;
  Proposal proposal_;
  TurnTaking turns_;
  const Bounds& bounds_;
  Next next_ = Next::kCeresStep;
  Eigen::VectorXd staged_state_;
  Eigen::VectorXd last_state_;    // of the blocks, in the last call
  int num_holds_ = 0;             // iterations without a valid step at the end
  double radius_ = 0.0;           // of the trust region
  bool has_explained_ = false;    // a step of Ceres, or tried to
  double cost_ = 0.0;             // at the last accepted state
  bool is_nonmonotonic_ = false;  // the step to it
  bool has_tried_ = false;        // the rule had its turn there
  double start_cost_ = 0.0;
  UpdateCallback::Summary summary_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_SOLVE_WITH_PROPOSALS_H_
