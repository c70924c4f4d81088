// The step that a rule or a function (proposal.h) proposes at a state of a
// ceres::Solve, and the state that it leads to.
//
//   candidate = Plus(x, scale step),   halved until L(candidate) <= L(x)
//
// projected onto the bounds, as Ceres does after Plus.
//
// After two halvings there is no proposal. The next proposal keeps the scale;
// it doubles, up to 1, with every proposal that Ceres accepts, or whose
// predicted decrease is too small. A rule that judges its steps (update_rule.h)
// adapts its own step size instead, and the scale of a function is always 1.
//
// A candidate from which Ceres cannot continue counts as higher: J^T J is not
// finite there, or the candidate lies in a flat region,
//
//   |gradient| |x| < 1e-10 L   and   |J d| |x| < 1e-10 sqrt(2 L),   d about 1,
//
// or the gradient is so small that Ceres may end the run there, and the solve
// without proposals ends lower. |x| is |step| if that is larger.
#ifndef INVGRAD_CERES_PROPOSAL_H_
#define INVGRAD_CERES_PROPOSAL_H_

#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/work_limit.h"
#include "invgrad/linearization.h"
#include "invgrad/proposal.h"
#include "invgrad/update_rule.h"

namespace invgrad {

// What makes proposals: a rule or, if it is null, a function.
struct Proposer {
  UpdateRule* rule = nullptr;
  ProposalFunction function;

  LinearizationParts Needs() const;
};

class Proposal {
 public:
  // Keeps the pointers.
  Proposal(double min_relative_model_decrease,
           const Proposer& proposer,
           const Bounds* bounds,
           const ceres::Problem& problem,
           ProblemLinearizer* linearizer,
           WorkLimit* work);

  // The problem must be at `state`, where the cost without the fixed cost is
  // `cost`. Return false, with *message, if there is no step, or no candidate.
  bool ComputeStep(double cost,
                   const Eigen::VectorXd& state,
                   std::string* message);
  // `may_end`: whether the run may end at this cost.
  bool FindCandidate(const std::function<bool(double cost)>& may_end,
                     std::string* message);

  const Eigen::VectorXd& step() const { return step_; }
  // Candidates of the last step that were too high.
  int num_withheld() const { return num_withheld_; }
  // Those of them at which the problem cannot be evaluated, and the step to the
  // first one.
  int num_outside_domain() const { return num_outside_domain_; }
  const Eigen::VectorXd& step_outside() const { return step_outside_; }
  // The problem at the state differs from that which Ceres evaluated.
  bool is_another_state() const { return is_another_state_; }

  // Ceres has decided; `cost`: of the candidate.
  void Decided(bool is_accepted, double cost);

 private:
  bool StepOfRule(std::string* message);
  bool StepOfFunction(std::string* message);
  // step = Minus(candidate, x)
  bool IntoTangentSpace(const Eigen::VectorXd& candidate, std::string* message);
  bool MoveTo(const Eigen::VectorXd& step);
  bool Linearize(Linearization* at_x, std::string* message);
  bool IsPromising(const Linearization& at_x) const;
  bool CanContinueFromCandidate(
      const std::function<bool(double cost)>& may_end) const;
  void HalveScale();
  void DoubleScale();

  const double min_relative_model_decrease_;
  const Proposer proposer_;
  StepJudge* const judge_;  // of the rule; may be null
  const Bounds& bounds_;
  std::shared_ptr<const ProblemState::Offsets> offsets_;  // for a function
  ProblemLinearizer& linearizer_;
  WorkLimit& work_;
  LinearizationParts parts_;  // that the rule needs, and J for the linear model
  bool needs_linearization_;  // to compute a step

  double cost_ = 0.0;
  Eigen::VectorXd state_;
  Eigen::VectorXd step_;  // n
  double scale_ = 1.0;
  double fraction_ = 1.0;  // step_ / the rule's step
  int num_withheld_ = 0;
  int num_outside_domain_ = 0;
  Eigen::VectorXd step_outside_;
  bool is_another_state_ = false;
  Eigen::VectorXd candidate_;  // empty: none
  Linearization at_candidate_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_PROPOSAL_H_
