#include "invgrad/ceres/update_callback.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/proposal.h"
#include "invgrad/ceres/safeguard.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/ceres/turn_taking.h"
#include "invgrad/ceres/work_limit.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
class UpdateCallback::State final : public ceres::IterationCallback {
 public:
  State(const Options& options, UpdateRule* rule, ceres::Problem* problem)
      : options_(Resolved(options)),
        rule_(rule),
        problem_(problem),
        linearizer_(problem, {{}, true, options.evaluation_callback}),
        turns_(options_.by_merit) {
    std::string error;
    CHECK(StagedStep::IsSupported(
        options_.max_block_size, linearizer_.structure(), *problem, &error))
        << error;
    staged_.emplace(linearizer_.structure(), problem);
  }

  void AddTo(ceres::Solver::Options* options) {
    work_.emplace(options_.max_relative_work,
                  options_.compare_with_plain,
                  *rule_,
                  *options,
                  linearizer_.Sizes());
    if (!work_->IsStepPossible()) {
      // The solve is then the one without a callback.
      summary_.message = work_->Message();
      staged_->Unwrap();
      return;
    }
    solver_options_ = *options;
    safeguard_.emplace(options_.compare_with_plain,
                       options,
                       options_.evaluation_callback,
                       problem_,
                       &linearizer_,
                       &*work_);
    proposal_.emplace(
        options_.min_relative_model_decrease, rule_, &linearizer_, &*work_);
    options->callbacks.push_back(this);
    options->update_state_every_iteration = true;
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    const ceres::CallbackReturnType result = PrepareNext(iteration);
    if (next_ != Next::kCeresStep) return result;
    staged_->Unwrap();
    if (!options_.only_proposals || result != ceres::SOLVER_CONTINUE) {
      return result;
    }
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  Summary summary() const {
    Summary summary = summary_;
    if (safeguard_) {
      if (safeguard_->plain()) {
        summary.num_plain_iterations = safeguard_->plain()->num_iterations;
      }
      if (!safeguard_->message().empty()) {
        summary.message = safeguard_->message();
      }
    }
    // Ceres calls no callback after a step that ends the run by a tolerance.
    if (next_ == Next::kProposal && !staged_->IsStaged()) {
      ++summary.num_proposed;
      summary.ended_on_proposal = true;
    }
    return summary;
  }

 private:
  // What replaces the next step of Ceres.
  enum class Next {
    kCeresStep,  // nothing
    kProposal,
    kPlainState,  // the result of the solve without proposals
    kSameState,   // a step of length zero, which ends the run
  };

  static Options Resolved(Options options) {
    if (options.only_proposals) {
      options.by_merit = false;
      options.compare_with_plain = false;
      options.max_relative_work = std::numeric_limits<double>::infinity();
    }
    return options;
  }

  // Less than Ceres' max_num_consecutive_invalid_steps.
  static constexpr int kMaxNumHolds = 3;
  static constexpr char kAnotherState[] =
      "the parameter blocks do not hold the solver's state; leave "
      "Solver::Options::update_state_every_iteration = true after AddTo, and "
      "change no parameter block in another callback";

  ceres::CallbackReturnType PrepareNext(
      const ceres::IterationSummary& iteration) {
    if (iteration.iteration == 0) {
      if (has_run_) {
        return Abort(
            "an UpdateCallback works for one solve; construct another one for "
            "the next");
      }
      has_run_ = true;
      if (iteration.trust_region_radius <= 0.0) {
        // A line search has no radius.
        return Abort(
            "UpdateCallback needs Solver::Options::minimizer_type = "
            "TRUST_REGION");
      }
    }
    // If all blocks are still staged, Ceres had no valid step to replace. (If a
    // Plus failed, some blocks may still be staged.)
    const bool was_passed_over = staged_->IsStaged();
    const Next made = was_passed_over ? Next::kCeresStep : next_;
    staged_->Clear();
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
    safeguard_->Observe(iteration, last_state_, is_own);
    const bool has_moved =
        made == Next::kPlainState && iteration.step_is_successful;
    if (has_moved && safeguard_->plain()->has_converged) {
      Stage(Next::kSameState);
      return ceres::SOLVER_CONTINUE;
    }
    if (!has_moved &&
        (next_ == Next::kPlainState || next_ == Next::kSameState)) {
      return Restage(was_passed_over);
    }
    if (Conclude()) return ceres::SOLVER_CONTINUE;
    const ceres::CallbackReturnType result =
        Continue(iteration, made, was_passed_over);
    if (next_ == Next::kCeresStep) Conclude();
    return result;
  }

  // Stages the end of the run if it is due.
  bool Conclude() {
    switch (safeguard_->verdict()) {
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
  ceres::CallbackReturnType Restage(bool was_passed_over) {
    summary_.has_converged = next_ == Next::kSameState;
    num_holds_ += was_passed_over;
    if (num_holds_ >= kMaxNumHolds) return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    Stage(next_);
    return ceres::SOLVER_CONTINUE;
  }

  ceres::CallbackReturnType Continue(const ceres::IterationSummary& iteration,
                                     Next made,
                                     bool was_passed_over) {
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
        proposal_->Decided(is_accepted, iteration.cost);
      } else {
        turns_.CeresStepped(gain);
      }
    }
    if (is_accepted) {
      cost_ = iteration.cost;
      is_nonmonotonic_ = iteration.step_is_nonmonotonic;
      has_tried_ = false;
    } else if (made != Next::kCeresStep || has_tried_ ||
               turns_.IsRuleWaiting() || !IsOutsideDomain(iteration)) {
      return ceres::SOLVER_CONTINUE;
    }
    return Propose(/*is_rules_turn=*/!is_accepted);
  }

  void Count(const ceres::IterationSummary& iteration, Next made) {
    const bool is_accepted = iteration.step_is_successful;
    if (made == Next::kProposal) {
      ++summary_.num_proposed;
      ++(is_accepted ? summary_.num_accepted : summary_.num_rejected);
    } else if (made == Next::kPlainState) {
      summary_.took_plain_result = is_accepted;
    } else if (made == Next::kCeresStep) {
      ++summary_.num_ceres_steps;
    }
  }

  // At the last accepted state.
  ceres::CallbackReturnType Propose(bool is_rules_turn) {
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
    if (work_->NeedsComparison()) safeguard_->Compare();
    if (!HasWorkLeft(work_->AllowsStep()) ||
        !proposal_->ComputeStep(cost_, last_state_, &summary_.message)) {
      if (proposal_->is_another_state()) return Abort(kAnotherState);
      turns_.RuleHadNoStep();
      return ceres::SOLVER_CONTINUE;
    }
    const bool has_candidate = proposal_->FindCandidate(&summary_.message);
    summary_.num_withheld += proposal_->num_withheld();
    ExplainProposal();
    if (!has_candidate) {
      turns_.RuleStepped(0.0);
      return ceres::SOLVER_CONTINUE;
    }
    safeguard_->Compare();
    if (HasWorkLeft(work_->AllowsIteration())) Stage(Next::kProposal);
    return ceres::SOLVER_CONTINUE;
  }

  DomainFailure::Options FailureOptions() const {
    return {options_.block_name, options_.evaluation_callback};
  }

  // Ceres does not expose its step, so it is computed again.
  void ExplainCeresStep(double radius) {
    if (summary_.first_outside_domain || has_repeated_) return;
    has_repeated_ = true;
    // The state of the trust region is not known, so that another radius may be
    // the one that leads outside.
    constexpr int kMaxNumIterations = 3;
    ceres::Solver::Options repeated = solver_options_;
    repeated.initial_trust_region_radius = radius;
    repeated.max_num_iterations = kMaxNumIterations;
    DomainFailure failure;
    if (FindDomainFailure(repeated,
                          FailureOptions(),
                          linearizer_.structure(),
                          *problem_,
                          &failure)) {
      summary_.first_outside_domain = std::move(failure);
    }
  }

  void ExplainProposal() {
    summary_.num_outside_domain += proposal_->num_outside_domain();
    if (summary_.first_outside_domain || proposal_->num_outside_domain() == 0) {
      return;
    }
    DomainFailure failure;
    if (ExplainFailingStep(FailureOptions(),
                           linearizer_.structure(),
                           proposal_->step_outside(),
                           &failure)) {
      summary_.first_outside_domain = std::move(failure);
    }
  }

  bool HasWorkLeft(bool has_work_left) {
    if (!has_work_left) summary_.message = work_->Message();
    return has_work_left;
  }

  void Stage(Next next) {
    next_ = next;
    if (next == Next::kProposal) {
      staged_->Stage(proposal_->step().data());
    } else {
      staged_state_ =
          next == Next::kSameState ? last_state_ : safeguard_->plain()->state;
      staged_->StageState(staged_state_.data());
    }
  }

  ceres::CallbackReturnType Abort(const std::string& message) {
    LOG(ERROR) << message;
    summary_.message = message;
    return ceres::SOLVER_ABORT;
  }

  const Options options_;
  UpdateRule* rule_;
  ceres::Problem* problem_;
  ProblemLinearizer linearizer_;
  std::optional<StagedStep> staged_;
  std::optional<WorkLimit> work_;
  std::optional<Safeguard> safeguard_;  // none: no proposals
  std::optional<Proposal> proposal_;
  bool has_run_ = false;
  Next next_ = Next::kCeresStep;
  Eigen::VectorXd staged_state_;
  Eigen::VectorXd last_state_;  // of the blocks, in the last call
  int num_holds_ = 0;           // iterations without a valid step at the end
  ceres::Solver::Options solver_options_;  // of AddTo
  double radius_ = 0.0;                    // of the trust region
  bool has_repeated_ = false;              // a step of Ceres, to explain it
  double cost_ = 0.0;                      // at the last accepted state
  bool is_nonmonotonic_ = false;           // the step to it
  bool has_tried_ = false;                 // the rule had its turn there
  double start_cost_ = 0.0;
  TurnTaking turns_;
  Summary summary_;
};

bool UpdateCallback::IsSupported(const Options& options,
                                 const ceres::Problem& problem,
                                 std::string* error) {
  return StagedStep::IsSupported(
      options.max_block_size, ReadStructure(problem, {}), problem, error);
}

UpdateCallback::UpdateCallback(UpdateRule* rule, ceres::Problem* problem)
    : UpdateCallback(rule, problem, Options()) {}

UpdateCallback::UpdateCallback(UpdateRule* rule,
                               ceres::Problem* problem,
                               const Options& options) {
  CHECK(rule != nullptr)
      << "MakeRule(specification, &error) returns no rule for an invalid "
         "specification; its error gives the reason.";
  CHECK(problem != nullptr);
  state_ = std::make_unique<State>(options, rule, problem);
}

UpdateCallback::~UpdateCallback() = default;

void UpdateCallback::AddTo(ceres::Solver::Options* options) {
  CHECK(options != nullptr);
  state_->AddTo(options);
}

UpdateCallback::Summary UpdateCallback::summary() const {
  return state_->summary();
}

std::string UpdateCallback::Summary::BriefReport() const {
  std::string report =
      fmt::format("{} proposed, {} accepted, {} rejected, {} steps of Ceres",
                  num_proposed,
                  num_accepted,
                  num_rejected,
                  num_ceres_steps);
  if (num_withheld > 0) report += fmt::format("; {} withheld", num_withheld);
  if (num_outside_domain > 0) {
    report += fmt::format("; {} outside the domain", num_outside_domain);
    if (first_outside_domain) report += ": " + first_outside_domain->ToText();
  }
  if (num_proposed == 0 && !message.empty()) report += "; " + message;
  if (ended_on_proposal) report += "; the run ended on a proposal";
  if (took_plain_result) report += "; the solve without proposals was better";
  return report;
}

}  // namespace invgrad
