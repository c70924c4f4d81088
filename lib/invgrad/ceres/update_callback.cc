#include "invgrad/ceres/update_callback.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "Eigen/Core"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/safeguard.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/ceres/turn_taking.h"
#include "invgrad/core/linearization.h"

namespace invgrad {
class UpdateCallback::State final : public ceres::IterationCallback {
 public:
  State(const Options& options, UpdateRule* rule, ceres::Problem* problem)
      : options_(options),
        rule_(rule),
        problem_(problem),
        linearizer_(problem, {}),
        parts_(rule->Needs()),
        needs_linearization_(parts_.gradient || parts_.jacobian ||
                             parts_.hessian),
        turns_(options.by_merit) {
    parts_.jacobian = true;
    std::string error;
    CHECK(StagedStep::IsSupported(
        options_.max_block_size, linearizer_.structure(), *problem, &error))
        << error;
    staged_.emplace(linearizer_.structure(), problem);
  }

  void AddSafeguard(ceres::Solver::Options* options) {
    safeguard_.emplace(
        options_.compare_with_plain, options, problem_, &linearizer_);
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    const ceres::CallbackReturnType result = PrepareNext(iteration);
    if (next_ == Next::kCeresStep) staged_->Unwrap();
    return result;
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

  static constexpr int kMaxNumTurnsLost = 8;
  // Less than Ceres' max_num_consecutive_invalid_steps.
  static constexpr int kMaxNumHolds = 3;
  static constexpr char kAnotherState[] =
      "the parameter blocks do not hold the solver's state; add the "
      "UpdateCallback by AddTo, leave "
      "Solver::Options::update_state_every_iteration = true, and change no "
      "parameter block in another callback";

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
    Eigen::VectorXd state = linearizer_.State();
    if (iteration.step_is_successful && !iteration.step_is_nonmonotonic &&
        iteration.step_norm > 0.0 && state == last_state_) {
      return Abort(kAnotherState);
    }
    last_state_ = std::move(state);
    if (next_ == Next::kSameState) {
      // Inner iterations moved further, or Ceres had no valid step. It tries
      // again with a smaller trust region, but fails after too many.
      summary_.has_converged = true;
      num_holds_ += was_passed_over;
      return num_holds_ < kMaxNumHolds
                 ? StageState(Next::kSameState, last_state_)
                 : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    if (safeguard_) {
      switch (safeguard_->Judge(
          iteration, last_state_, /*is_own=*/made == Next::kCeresStep)) {
        case Safeguard::Verdict::kConverged:
          return StageState(Next::kSameState, last_state_);
        case Safeguard::Verdict::kPlainIsBetter:
          return StageState(Next::kPlainState, safeguard_->plain()->state);
        case Safeguard::Verdict::kContinue:
          break;
      }
    }
    return Continue(iteration, made, was_passed_over);
  }

  ceres::CallbackReturnType Continue(const ceres::IterationSummary& iteration,
                                     Next made,
                                     bool was_passed_over) {
    next_ = Next::kCeresStep;
    if (made == Next::kProposal && rule_->JudgesSteps()) {
      // Ceres has decided; the result of KeepsStep is not used.
      rule_->KeepsStep(iteration.cost, fraction_);
    }
    if (iteration.iteration == 0) {
      start_cost_ = cost_ = iteration.cost;
      return Propose(iteration);
    }
    const double gain =
        iteration.step_is_successful ? std::log(cost_ / iteration.cost) : 0.0;
    if (made == Next::kProposal) {
      turns_.RuleStepped(gain);
    } else if (!was_passed_over) {
      turns_.CeresStepped(gain);
    }
    if (iteration.step_is_successful) {
      cost_ = iteration.cost;
      if (made == Next::kProposal) scale_ = std::min(2.0 * scale_, 1.0);
      return Propose(iteration);
    }
    if (was_passed_over) {
      Stage();
    } else if (made == Next::kProposal) {
      BackOff();
    } else {
      // The trust region is too large for Ceres itself.
      lost_radius_ = 0.0;
      summary_.message = "Ceres' own step was rejected at this state";
    }
    return ceres::SOLVER_CONTINUE;
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

  ceres::CallbackReturnType Propose(const ceres::IterationSummary& iteration) {
    if (iteration.step_is_nonmonotonic) {
      // The blocks hold the state of least cost, not the current state.
      summary_.message = "the last step was nonmonotonic";
      return ceres::SOLVER_CONTINUE;
    }
    constexpr double kRounding = std::numeric_limits<double>::epsilon();
    if (iteration.cost <= kRounding * kRounding * start_cost_) {
      summary_.message = "the cost is zero up to rounding";
      return ceres::SOLVER_CONTINUE;
    }
    if (iteration.trust_region_radius < lost_radius_ && num_turns_lost_ > 0) {
      --num_turns_lost_;
      summary_.message =
          "Ceres' trust region is still smaller than before a rejected "
          "proposal";
      return ceres::SOLVER_CONTINUE;
    }
    lost_radius_ = 0.0;
    if (!turns_.IsTheRules()) return ceres::SOLVER_CONTINUE;
    num_backoffs_ = 0;
    radius_ = iteration.trust_region_radius;
    fraction_ = scale_;
    if (ComputeStep(iteration)) {
      Stage();
    } else if (is_another_state_) {
      return Abort(kAnotherState);
    } else {
      turns_.RuleHadNoStep();
    }
    return ceres::SOLVER_CONTINUE;
  }

  // Sets step_, or summary_.message if there is no step. For a rule that needs
  // no linearization, linearizes the problem only if there is a step.
  bool ComputeStep(const ceres::IterationSummary& iteration) {
    Linearization at_x;
    at_x.cost = iteration.cost;
    if ((needs_linearization_ && !Linearize(iteration, &at_x)) ||
        !rule_->ComputeStep(at_x, &step_, &summary_.message)) {
      return false;
    }
    CHECK_EQ(step_.size(), linearizer_.num_parameters());
    step_ *= scale_;
    if (!needs_linearization_ && !Linearize(iteration, &at_x)) return false;
    if (IsPromising(at_x)) return true;
    summary_.message =
        "the linear model predicts too small a decrease of the cost";
    // The scale may be too small, and only a proposal can raise it.
    scale_ = std::min(2.0 * scale_, 1.0);
    return false;
  }

  bool Linearize(const ceres::IterationSummary& iteration,
                 Linearization* at_x) {
    if (!linearizer_.Linearize(parts_, at_x, &summary_.message)) return false;
    // At the same state the two sums differ by rounding. Both contain the fixed
    // cost of residual blocks that cannot change.
    constexpr double kCostTolerance = 1e-9;
    is_another_state_ = !(std::abs(at_x->cost - iteration.cost) <=
                          kCostTolerance * std::abs(iteration.cost));
    return !is_another_state_;
  }

  // Whether the linear model predicts a large enough L(x) - L(x + step); false
  // for NaN.
  bool IsPromising(const Linearization& at_x) const {
    Eigen::VectorXd J_step;
    at_x.jacobian->Times(step_, &J_step);
    const double decrease =
        -at_x.loss_gradient.dot(J_step) - 0.5 * J_step.squaredNorm();
    return decrease >= options_.min_relative_model_decrease * at_x.cost;
  }

  void BackOff() {
    // A rule that judges its steps adapts its own step size.
    if (!rule_->JudgesSteps()) scale_ *= 0.5;
    if (num_backoffs_ >= options_.max_num_backoffs) {
      // Each rejection shrinks Ceres' trust region; three shrink it by a factor
      // of 64. More proposals would make Ceres' own steps so short that its
      // function tolerance ends the run far from a minimum (measured in
      // Rosenbrock's valley). The radius of LM recovers within four good steps;
      // the radius of dogleg only grows to the length of its steps.
      lost_radius_ = radius_;
      num_turns_lost_ = kMaxNumTurnsLost;
      summary_.message = fmt::format("the last proposal was rejected {} times",
                                     num_backoffs_ + 1);
      return;
    }
    ++num_backoffs_;
    step_ *= 0.5;
    fraction_ *= 0.5;
    Stage();
  }

  void Stage() {
    staged_->Stage(step_.data());
    next_ = Next::kProposal;
  }

  ceres::CallbackReturnType StageState(Next next, Eigen::VectorXd state) {
    staged_state_ = std::move(state);
    staged_->StageState(staged_state_.data());
    next_ = next;
    return ceres::SOLVER_CONTINUE;
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
  LinearizationParts parts_;  // that the rule needs, and J for the linear model
  const bool needs_linearization_;  // to compute a step
  std::optional<StagedStep> staged_;
  std::optional<Safeguard> safeguard_;
  Eigen::VectorXd step_;  // n: the last proposal
  bool has_run_ = false;
  bool is_another_state_ = false;  // the blocks do not hold the solver's state
  Next next_ = Next::kCeresStep;
  Eigen::VectorXd staged_state_;
  Eigen::VectorXd last_state_;  // of the blocks, in the last call
  int num_holds_ = 0;           // iterations without a valid step at the end
  int num_backoffs_ = 0;        // of the last proposal
  double radius_ = 0.0;         // Ceres' radius at the first attempt of this
                                // proposal
  double scale_ = 1.0;          // of proposals: the scale of the last accepted
                                // ones
  double fraction_ = 1.0;       // step_ / the rule's step
  // Ceres has the turn while its radius is smaller,
  double lost_radius_ = 0.0;
  int num_turns_lost_ = 0;  // but no more turns than these
  double cost_ = 0.0;       // at the last accepted state
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
  CHECK(rule != nullptr);
  CHECK(problem != nullptr);
  state_ = std::make_unique<State>(options, rule, problem);
}

UpdateCallback::~UpdateCallback() = default;

void UpdateCallback::AddTo(ceres::Solver::Options* options) {
  CHECK(options != nullptr);
  state_->AddSafeguard(options);
  options->callbacks.push_back(state_.get());
  options->update_state_every_iteration = true;
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
  if (num_proposed == 0 && !message.empty()) report += "; " + message;
  if (ended_on_proposal) report += "; the run ended on a proposal";
  if (took_plain_result) report += "; the solve without proposals was better";
  return report;
}

}  // namespace invgrad
