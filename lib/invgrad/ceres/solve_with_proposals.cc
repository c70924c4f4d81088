#include "invgrad/ceres/solve_with_proposals.h"

#include <cmath>
#include <limits>
#include <utility>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// Less than Ceres' max_num_consecutive_invalid_steps.
constexpr int kMaxNumHolds = 3;
constexpr char kAnotherState[] =
    "the parameter blocks do not hold the solver's state; leave "
    "Solver::Options::update_state_every_iteration = true after AddTo, and "
    "change no parameter block in another callback";

}  // namespace

SolveWithProposals::SolveWithProposals(const UpdateCallback::Options& options,
                                       const WorkLimit& work,
                                       const Proposer& proposer,
                                       const Bounds* bounds,
                                       const ceres::Problem* problem,
                                       ProblemLinearizer* linearizer,
                                       StagedStep* staged,
                                       ceres::Solver::Options* solver_options)
    : options_(options),
      solver_options_(*solver_options),
      problem_(*problem),
      linearizer_(*linearizer),
      staged_(*staged),
      variable_cost_(*problem, linearizer),
      work_(work),
      safeguard_(options_.compare_with_plain,
                 bounds->any(),
                 solver_options,
                 options_.evaluation_callback,
                 problem,
                 linearizer,
                 &work_),
      proposal_(options_.min_relative_model_decrease,
                proposer,
                bounds,
                *problem,
                linearizer,
                &work_),
      turns_(options_.by_merit),
      bounds_(*bounds) {
  // Ceres' projected line search calls Plus several times for a candidate.
  if (bounds_.any())
    solver_options->max_num_line_search_step_size_iterations = 0;
}

ceres::CallbackReturnType SolveWithProposals::operator()(
    const ceres::IterationSummary& iteration) {
  ceres::IterationSummary without_fixed = iteration;
  without_fixed.cost = variable_cost_.Of(iteration);
  const ceres::CallbackReturnType result = PrepareNext(without_fixed);
  if (next_ != Next::kCeresStep) return result;
  staged_.Unwrap();
  if (!options_.only_proposals || result != ceres::SOLVER_CONTINUE) {
    return result;
  }
  return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
}

UpdateCallback::Summary SolveWithProposals::summary() const {
  UpdateCallback::Summary summary = summary_;
  if (safeguard_.plain()) {
    summary.num_plain_iterations = safeguard_.plain()->num_iterations;
    summary.num_limited_steps = safeguard_.plain()->num_limited_steps;
  }
  summary.predicted_decrease = safeguard_.predicted_decrease();
  if (!safeguard_.message().empty()) summary.message = safeguard_.message();
  // Ceres calls no callback after a step that ends the run by a tolerance.
  if (next_ == Next::kProposal && !staged_.IsStaged()) {
    ++summary.num_proposed;
    summary.ended_on_proposal = true;
  }
  return summary;
}

ceres::CallbackReturnType SolveWithProposals::PrepareNext(
    const ceres::IterationSummary& iteration) {
  // A line search has no radius.
  if (iteration.iteration == 0 && iteration.trust_region_radius <= 0.0) {
    return Abort(
        "UpdateCallback needs Solver::Options::minimizer_type = "
        "TRUST_REGION");
  }
  // If all blocks are still staged, Ceres had no valid step to replace. (If a
  // Plus failed, some blocks may still be staged.)
  const bool was_passed_over = staged_.IsStaged();
  const Next made = was_passed_over ? Next::kCeresStep : next_;
  staged_.Clear();
  if (iteration.iteration > 0) Count(iteration, made);
  const double last_radius =
      std::exchange(radius_, iteration.trust_region_radius);
  Eigen::VectorXd state = linearizer_.State();
  if (iteration.step_is_successful && !iteration.step_is_nonmonotonic &&
      iteration.step_norm > 0.0 && state == last_state_) {
    return Abort(kAnotherState);
  }
  last_state_ = std::move(state);
  const bool is_own = made == Next::kCeresStep;
  const bool is_outside = IsOutsideDomain(iteration);
  if (is_outside) ++summary_.num_outside_domain;
  if (is_outside && is_own) ExplainCeresStep(last_radius);
  safeguard_.Observe(iteration, last_state_, is_own);
  const bool has_moved =
      made == Next::kPlainState && iteration.step_is_successful;
  if (has_moved && safeguard_.plain()->has_converged) {
    Stage(Next::kSameState);
    return ceres::SOLVER_CONTINUE;
  }
  if (!has_moved && (next_ == Next::kPlainState || next_ == Next::kSameState)) {
    return Restage(was_passed_over);
  }
  if (Conclude()) return ceres::SOLVER_CONTINUE;
  const ceres::CallbackReturnType result =
      Continue(iteration, made, was_passed_over);
  if (next_ == Next::kCeresStep) Conclude();
  return result;
}

// Stages the end of the run if it is due.
bool SolveWithProposals::Conclude() {
  switch (safeguard_.verdict()) {
    case Safeguard::Verdict::kConverged:
      Stage(Next::kSameState);
      return true;
    case Safeguard::Verdict::kPlainIsBetter:
      Stage(Next::kPlainState);
      return true;
    case Safeguard::Verdict::kContinue:
      break;
  }
  return false;
}

// The state was staged, and the run still continues: Ceres had no valid step
// or rejected the state, or inner iterations moved further. Ceres tries again
// with a smaller trust region, but fails after too many invalid steps.
ceres::CallbackReturnType SolveWithProposals::Restage(bool was_passed_over) {
  summary_.has_converged = next_ == Next::kSameState;
  num_holds_ += was_passed_over;
  if (num_holds_ >= kMaxNumHolds) return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  Stage(next_);
  return ceres::SOLVER_CONTINUE;
}

ceres::CallbackReturnType SolveWithProposals::Continue(
    const ceres::IterationSummary& iteration, Next made, bool was_passed_over) {
  next_ = Next::kCeresStep;
  const bool is_accepted = iteration.step_is_successful;
  if (iteration.iteration == 0) {
    start_cost_ = iteration.cost;
  } else if (was_passed_over) {
    Stage(Next::kProposal);  // again
  } else {
    const double gain = is_accepted ? std::log(cost_ / iteration.cost) : 0.0;
    if (made == Next::kProposal) {
      turns_.RuleStepped(gain);
      proposal_.Decided(is_accepted, iteration.cost);
    } else {
      turns_.CeresStepped(gain);
    }
  }
  if (is_accepted) {
    cost_ = iteration.cost;
    is_nonmonotonic_ = iteration.step_is_nonmonotonic;
    has_tried_ = false;
  } else if (made != Next::kCeresStep || has_tried_ || turns_.IsRuleWaiting() ||
             !IsOutsideDomain(iteration)) {
    return ceres::SOLVER_CONTINUE;
  }
  return Propose(/*is_rules_turn=*/!is_accepted);
}

void SolveWithProposals::Count(const ceres::IterationSummary& iteration,
                               Next made) {
  const bool is_accepted = iteration.step_is_successful;
  if (made == Next::kProposal) {
    ++summary_.num_proposed;
    ++(is_accepted ? summary_.num_accepted : summary_.num_rejected);
  } else if (made == Next::kPlainState) {
    summary_.took_plain_result = is_accepted;
  } else if (made == Next::kCeresStep) {
    ++summary_.num_ceres_steps;
    if (Safeguard::IsLimited(iteration)) ++summary_.num_limited_steps;
  }
}

// At the last accepted state.
ceres::CallbackReturnType SolveWithProposals::Propose(bool is_rules_turn) {
  if (is_nonmonotonic_) {
    // The blocks hold the state of least cost, not the current state.
    summary_.message = "the last step was nonmonotonic";
    return ceres::SOLVER_CONTINUE;
  }
  constexpr double kRounding = std::numeric_limits<double>::epsilon();
  if (cost_ <= kRounding * kRounding * start_cost_) {
    summary_.message = "the cost is zero up to rounding";
    return ceres::SOLVER_CONTINUE;
  }
  if (!is_rules_turn && !turns_.IsTheRules()) return ceres::SOLVER_CONTINUE;
  has_tried_ = true;
  // With bounds, Ceres' steps are others than those of the plain solve.
  if (work_.NeedsComparison() || bounds_.any()) safeguard_.Compare();
  if (!HasWorkLeft(work_.AllowsStep()) ||
      !proposal_.ComputeStep(cost_, last_state_, &summary_.message)) {
    if (proposal_.is_another_state()) return Abort(kAnotherState);
    turns_.RuleHadNoStep();
    return ceres::SOLVER_CONTINUE;
  }
  const auto may_end = [this](double cost) {
    safeguard_.Compare();
    return !safeguard_.IsPlainBetterThan(cost);
  };
  const bool has_candidate =
      proposal_.FindCandidate(may_end, &summary_.message);
  summary_.num_withheld += proposal_.num_withheld();
  ExplainProposal();
  if (!has_candidate) {
    turns_.RuleStepped(0.0);
    return ceres::SOLVER_CONTINUE;
  }
  safeguard_.Compare();
  if (HasWorkLeft(work_.AllowsIteration())) Stage(Next::kProposal);
  return ceres::SOLVER_CONTINUE;
}

DomainFailure::Options SolveWithProposals::FailureOptions() const {
  return {options_.block_name, options_.evaluation_callback};
}

// Ceres does not expose its step, so it is computed again.
void SolveWithProposals::ExplainCeresStep(double radius) {
  if (summary_.first_outside_domain || has_explained_) return;
  has_explained_ = true;
  ceres::Solver::Options solver_options = solver_options_;
  solver_options.initial_trust_region_radius = radius;
  DomainFailure failure;
  if (ExplainNextStep(solver_options,
                      FailureOptions(),
                      linearizer_.structure(),
                      problem_,
                      &failure)) {
    summary_.first_outside_domain = std::move(failure);
  }
}

void SolveWithProposals::ExplainProposal() {
  summary_.num_outside_domain += proposal_.num_outside_domain();
  if (summary_.first_outside_domain || proposal_.num_outside_domain() == 0) {
    return;
  }
  DomainFailure failure;
  if (ExplainFailingStep(FailureOptions(),
                         linearizer_.structure(),
                         bounds_,
                         proposal_.step_outside(),
                         &failure)) {
    summary_.first_outside_domain = std::move(failure);
  }
}

bool SolveWithProposals::HasWorkLeft(bool has_work_left) {
  if (!has_work_left) summary_.message = work_.Message();
  return has_work_left;
}

void SolveWithProposals::Stage(Next next) {
  next_ = next;
  if (next == Next::kProposal) {
    staged_.Stage(proposal_.step().data());
  } else {
    staged_state_ =
        next == Next::kSameState ? last_state_ : safeguard_.plain()->state;
    staged_.StageState(staged_state_.data());
  }
}

ceres::CallbackReturnType SolveWithProposals::Abort(
    const std::string& message) {
  LOG(ERROR) << message;
  summary_.message = message;
  return ceres::SOLVER_ABORT;
}

}  // namespace invgrad
