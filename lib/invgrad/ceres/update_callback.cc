#include "invgrad/ceres/update_callback.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "Eigen/Core"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/ceres/turn_taking.h"
#include "invgrad/core/linearization.h"

namespace invgrad {
namespace {

bool IsBounded(const ceres::Problem& problem, const double* values, int size) {
  // "If the parameter is not bounded by the user" (ceres/problem.h).
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  for (int i = 0; i < size; ++i) {
    if (problem.GetParameterLowerBound(values, i) > -kUnbounded ||
        problem.GetParameterUpperBound(values, i) < kUnbounded) {
      return true;
    }
  }
  return false;
}

// Whether a proposal can be staged for all blocks.
bool AreSupported(const UpdateCallback::Options& options,
                  const ceres::Problem& problem,
                  const ProblemStructure& structure,
                  std::string* error) {
  int i = 0;
  for (const auto& block : structure.parameter_blocks) {
    const std::string name =
        fmt::format("parameter block {} (of those that are not constant)", i++);
    if (block.tangent_size > options.max_block_size) {
      *error = fmt::format(
          "{} has size {}, which is larger than max_block_size = {}; split it "
          "into smaller blocks, or use Minimize",
          name,
          block.tangent_size,
          options.max_block_size);
      return false;
    }
    if (IsBounded(problem, block.values, block.ambient_size)) {
      *error = name +
               " has bounds, which UpdateCallback does not support; replace "
               "them by a change of variables, or solve without "
               "UpdateCallback";
      return false;
    }
  }
  return true;
}

}  // namespace

class UpdateCallback::State final : public ceres::IterationCallback {
 public:
  State(const Options& options, UpdateRule* rule, ceres::Problem* problem)
      : options_(options),
        rule_(rule),
        linearizer_(problem, {}),
        parts_(rule->Needs()),
        needs_linearization_(parts_.gradient || parts_.jacobian ||
                             parts_.hessian),
        turns_(options.by_merit) {
    parts_.jacobian = true;
    std::string error;
    CHECK(AreSupported(options_, *problem, linearizer_.structure(), &error))
        << error;
    staged_.emplace(linearizer_.structure(), problem);
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    const ceres::CallbackReturnType result = PrepareNext(iteration);
    if (!has_proposal_) staged_->Unwrap();
    return result;
  }

  Summary summary() const {
    Summary summary = summary_;
    // Ceres calls no callback after a step that ends the run by a tolerance.
    if (has_proposal_ && !staged_->IsStaged()) ++summary.num_proposed;
    return summary;
  }

 private:
  static constexpr int kMaxNumTurnsLost = 8;

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
      cost_ = iteration.cost;
      return Propose(iteration);
    }
    // If all blocks are still staged, Ceres had no valid step to replace. (If a
    // Plus failed, some blocks may still be staged.)
    const bool was_passed_over = staged_->IsStaged();
    const bool was_proposed = has_proposal_ && !was_passed_over;
    staged_->Clear();
    has_proposal_ = false;
    const double gain =
        iteration.step_is_successful ? std::log(cost_ / iteration.cost) : 0.0;
    if (was_proposed) {
      ++summary_.num_proposed;
      ++(iteration.step_is_successful ? summary_.num_accepted
                                      : summary_.num_rejected);
      // Ceres has decided; the result of KeepsStep is not used.
      if (rule_->JudgesSteps()) rule_->KeepsStep(iteration.cost, fraction_);
      turns_.RuleStepped(gain);
    } else {
      ++summary_.num_ceres_steps;
      if (!was_passed_over) turns_.CeresStepped(gain);
    }
    if (iteration.step_is_successful) {
      cost_ = iteration.cost;
      if (was_proposed) scale_ = std::min(2.0 * scale_, 1.0);
      return Propose(iteration);
    }
    if (was_passed_over) {
      Stage();
    } else if (was_proposed) {
      BackOff();
    } else {
      // The trust region is too large for Ceres itself.
      lost_radius_ = 0.0;
      summary_.message = "Ceres' own step was rejected at this state";
    }
    return ceres::SOLVER_CONTINUE;
  }

  ceres::CallbackReturnType Propose(const ceres::IterationSummary& iteration) {
    if (iteration.step_is_nonmonotonic) {
      // The blocks hold the state of least cost, not the current state.
      summary_.message = "the last step was nonmonotonic";
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
      return Abort(
          "the parameter blocks do not hold the solver's state; add the "
          "UpdateCallback by AddTo, leave "
          "Solver::Options::update_state_every_iteration = true, and change no "
          "parameter block in another callback");
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
    has_proposal_ = true;
  }

  ceres::CallbackReturnType Abort(const std::string& message) {
    LOG(ERROR) << message;
    summary_.message = message;
    return ceres::SOLVER_ABORT;
  }

  const Options options_;
  UpdateRule* rule_;
  const ProblemLinearizer linearizer_;
  LinearizationParts parts_;  // that the rule needs, and J for the linear model
  const bool needs_linearization_;  // to compute a step
  std::optional<StagedStep> staged_;
  Eigen::VectorXd step_;  // n: the last proposal
  bool has_run_ = false;
  bool is_another_state_ = false;  // the blocks do not hold the solver's state
  bool has_proposal_ = false;      // staged in the last call
  int num_backoffs_ = 0;           // of the last proposal
  double radius_ = 0.0;            // Ceres' radius at the first attempt of this
                                   // proposal
  double scale_ = 1.0;     // of proposals: the scale of the last accepted
                           // ones
  double fraction_ = 1.0;  // step_ / the rule's step
  // Ceres has the turn while its radius is smaller,
  double lost_radius_ = 0.0;
  int num_turns_lost_ = 0;  // but no more turns than these
  double cost_ = 0.0;       // at the last accepted state
  TurnTaking turns_;
  Summary summary_;
};

bool UpdateCallback::IsSupported(const Options& options,
                                 const ceres::Problem& problem,
                                 std::string* error) {
  return AreSupported(options, problem, ReadStructure(problem, {}), error);
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
  options->callbacks.push_back(iteration_callback());
  options->update_state_every_iteration = true;
}

ceres::IterationCallback* UpdateCallback::iteration_callback() {
  return state_.get();
}

UpdateCallback::Summary UpdateCallback::summary() const {
  return state_->summary();
}

std::string UpdateCallback::Summary::BriefReport() const {
  return fmt::format("{} proposed, {} accepted, {} rejected, {} steps of Ceres",
                     num_proposed,
                     num_accepted,
                     num_rejected,
                     num_ceres_steps);
}

}  // namespace invgrad
