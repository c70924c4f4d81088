#include "invgrad/ceres/update_callback.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "Eigen/Core"
#include "ceres/local_parameterization.h"
#include "ceres/manifold.h"
#include "glog/logging.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/turn_taking.h"
#include "invgrad/core/linearization.h"

namespace invgrad {
namespace {

// A block's own manifold, or the Euclidean one, which takes a staged step in
// the place of the next that it is given. Ceres asks it for sizes and Jacobians
// once a residual block and evaluation, so it is small, and does the Euclidean
// case itself.
class StagingManifold final : public ceres::Manifold {
 public:
  // `own` is null for a Euclidean block; not owned.
  StagingManifold(int ambient_size, const ceres::Manifold* own)
      : ambient_size_(ambient_size),
        tangent_size_(own != nullptr ? own->TangentSize() : ambient_size),
        own_(own) {}

  // `step` must stay until it is taken or cleared.
  void Stage(const double* step) { staged_ = step; }
  void Clear() { staged_ = nullptr; }
  bool is_staged() const { return staged_ != nullptr; }

  int AmbientSize() const override { return ambient_size_; }
  int TangentSize() const override { return tangent_size_; }

  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    // Written only if something is staged: then Ceres forms its candidate, and
    // calls Plus once. Inner iterations call it from several threads.
    if (staged_ != nullptr) {
      delta = staged_;
      staged_ = nullptr;
    }
    if (own_ != nullptr) return own_->Plus(x, delta, x_plus_delta);
    std::transform(
        x, x + ambient_size_, delta, x_plus_delta, std::plus<double>());
    return true;
  }

  bool PlusJacobian(const double* x, double* jacobian) const override {
    if (own_ != nullptr) return own_->PlusJacobian(x, jacobian);
    SetIdentity(jacobian);
    return true;
  }
  bool RightMultiplyByPlusJacobian(const double* x,
                                   const int num_rows,
                                   const double* ambient_matrix,
                                   double* tangent_matrix) const override {
    if (own_ != nullptr) {
      return own_->RightMultiplyByPlusJacobian(
          x, num_rows, ambient_matrix, tangent_matrix);
    }
    std::copy_n(ambient_matrix, num_rows * ambient_size_, tangent_matrix);
    return true;
  }
  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    if (own_ != nullptr) return own_->Minus(y, x, y_minus_x);
    std::transform(y, y + ambient_size_, x, y_minus_x, std::minus<double>());
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    if (own_ != nullptr) return own_->MinusJacobian(x, jacobian);
    SetIdentity(jacobian);
    return true;
  }

 private:
  void SetIdentity(double* matrix) const {
    std::fill_n(matrix, ambient_size_ * ambient_size_, 0.0);
    for (int i = 0; i < ambient_size_; ++i) matrix[i * ambient_size_ + i] = 1.0;
  }

  const int ambient_size_;
  const int tangent_size_;
  const ceres::Manifold* const own_;
  mutable const double* staged_ = nullptr;
};

// Ceres 2.1 still has local parameterizations, and so has code that uses it.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"

// What a block had before it was wrapped.
struct OwnManifold {
  // A local parameterization is a manifold too.
  OwnManifold(const ceres::Problem& problem,
              double* values,
              const ceres::Manifold* manifold)
      : values(values),
        manifold(manifold),
        parameterization(manifold == nullptr
                             ? nullptr
                             : problem.GetParameterization(values)) {}

  void Restore(ceres::Problem* problem) const {
    // Ceres takes them as pointers to what it may delete, and hands them out as
    // pointers to const.
    if (parameterization != nullptr) {
      problem->SetParameterization(
          values, const_cast<ceres::LocalParameterization*>(parameterization));
    } else {
      problem->SetManifold(values, const_cast<ceres::Manifold*>(manifold));
    }
  }

  double* values;
  const ceres::Manifold* manifold;  // null: none
  const ceres::LocalParameterization* parameterization;
};

#pragma GCC diagnostic pop

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

// Whether a proposal can be staged for all of the linearizer's blocks.
bool AreSupported(const UpdateCallback::Options& options,
                  const ceres::Problem& problem,
                  const ProblemLinearizer& linearizer,
                  std::string* error) {
  const std::vector<double*>& blocks = linearizer.parameter_blocks();
  const auto name = [](int i) {
    return "parameter block " + std::to_string(i) + " (of those not constant)";
  };
  for (int i = 0; i < static_cast<int>(blocks.size()); ++i) {
    const int size = linearizer.tangent_size(i);
    if (size > options.max_block_size) {
      *error = name(i) + " has size " + std::to_string(size) + " > " +
               std::to_string(options.max_block_size) +
               " = max_block_size; split it into smaller blocks, or use "
               "Minimize";
      return false;
    }
    if (IsBounded(problem, blocks[i], linearizer.ambient_size(i))) {
      *error = name(i) +
               " has bounds, with which proposals do not work; remove the "
               "bounds (a change of variables can take their place), or solve "
               "without UpdateCallback";
      return false;
    }
  }
  return true;
}

bool NeedsLinearization(const UpdateRule& rule) {
  const LinearizationParts parts = rule.Needs();
  return parts.gradient || parts.jacobian || parts.hessian;
}

UpdateCallback::Options WithSharedManifolds(UpdateCallback::Options options) {
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

}  // namespace

class UpdateCallback::State {
 public:
  State(const Options& options, UpdateRule* rule, ceres::Problem* problem)
      : options_(options),
        rule_(rule),
        problem_(problem),
        // Before wrapping: it moves by the blocks' own manifolds.
        linearizer_(problem, {}),
        needs_linearization_(NeedsLinearization(*rule)),
        turns_(options.by_merit) {
    std::string error;
    CHECK(AreSupported(options_, *problem, linearizer_, &error)) << error;
    const std::vector<double*>& blocks = linearizer_.parameter_blocks();
    own_.reserve(blocks.size());
    staging_.reserve(blocks.size());
    for (int i = 0; i < static_cast<int>(blocks.size()); ++i) {
      CHECK(dynamic_cast<const StagingManifold*>(linearizer_.manifold(i)) ==
            nullptr)
          << "Another UpdateCallback of this problem is still alive.";
      own_.emplace_back(*problem, blocks[i], linearizer_.manifold(i));
      staging_.push_back(new StagingManifold(linearizer_.ambient_size(i),
                                             linearizer_.manifold(i)));
      if (options_.manifold_ownership == ceres::DO_NOT_TAKE_OWNERSHIP) {
        owned_.emplace_back(staging_.back());
      }
    }
    // In a loop of its own, so that Ceres, which visits them all in each of its
    // evaluations, finds them side by side in memory.
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      problem->SetManifold(blocks[i], staging_[i]);
    }
  }

  ~State() {
    for (const OwnManifold& own : own_) {
      if (own.manifold != nullptr || is_wrapped_) own.Restore(problem_);
    }
  }

  ceres::CallbackReturnType OnIteration(
      const ceres::IterationSummary& iteration) {
    const ceres::CallbackReturnType result = PrepareNext(iteration);
    if (!has_proposal_) SetWrapped(false);
    return result;
  }

  Summary summary() const {
    Summary summary = summary_;
    // Ceres ends a run on its tolerances without calling anyone back.
    if (has_proposal_ && !IsStaged()) ++summary.num_proposed;
    return summary;
  }

 private:
  enum class Outcome { kStep, kNoStep, kAnotherState };

  static constexpr int kMostTurnsLost = 8;
  // A problem that owns its manifolds remembers each one that it is given, also
  // those that it has been given before.
  static constexpr int kMostUnwraps = 32;

  ceres::CallbackReturnType PrepareNext(
      const ceres::IterationSummary& iteration) {
    if (iteration.iteration == 0) {
      if (has_run_) {
        return Abort(
            "an UpdateCallback is for one solve; make another for the next");
      }
      has_run_ = true;
      if (iteration.trust_region_radius <= 0.0) {
        // A trust region has a radius, a line search has not.
        return Abort(
            "UpdateCallback needs Solver::Options::minimizer_type = "
            "TRUST_REGION");
      }
    } else {
      Count(iteration);
    }
    // What is still staged was not used: Ceres found no valid step of its own
    // to replace. (Of a Plus that failed, some blocks may be left; none may
    // stay.)
    const bool was_passed_over = IsStaged();
    const bool was_proposed = has_proposal_ && !was_passed_over;
    if (was_proposed && rule_->JudgesSteps()) {
      // Whatever the rule thinks of it, Ceres has decided.
      rule_->KeepsStep(iteration.cost, fraction_);
    }
    for (StagingManifold* manifold : staging_) manifold->Clear();
    has_proposal_ = false;

    if (iteration.iteration == 0) {
      cost_ = iteration.cost;
      return Propose(iteration);
    }
    const double gain =
        iteration.step_is_successful ? std::log(cost_ / iteration.cost) : 0.0;
    if (was_proposed) {
      turns_.RuleStepped(gain);
    } else if (!was_passed_over) {
      turns_.CeresStepped(gain);
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
      // Ceres finds its trust region too large, so nothing was taken from it.
      lost_radius_ = 0.0;
      summary_.message = "Ceres' own step was rejected at this state";
    }
    return ceres::SOLVER_CONTINUE;
  }

  // Whether Ceres has moved no block since the last call. (Blocks that no
  // residual block names are never moved, and a Plus that fails ends a move.)
  bool IsStaged() const {
    return !staging_.empty() &&
           std::all_of(
               staging_.begin(), staging_.end(), [](const auto* manifold) {
                 return manifold->is_staged();
               });
  }

  void Count(const ceres::IterationSummary& iteration) {
    if (!has_proposal_ || IsStaged()) {
      ++summary_.num_ceres_steps;
      return;
    }
    ++summary_.num_proposed;
    if (iteration.step_is_successful) {
      ++summary_.num_accepted;
    } else {
      ++summary_.num_rejected;
    }
  }

  ceres::CallbackReturnType Propose(const ceres::IterationSummary& iteration) {
    if (iteration.step_is_nonmonotonic) {
      // Ceres shows the state of the least cost, which is another one.
      summary_.message = "the last step was nonmonotonic";
      return ceres::SOLVER_CONTINUE;
    }
    if (iteration.trust_region_radius < lost_radius_ && num_turns_lost_ > 0) {
      --num_turns_lost_;
      summary_.message =
          "Ceres' trust region has not recovered from a rejected proposal";
      return ceres::SOLVER_CONTINUE;
    }
    lost_radius_ = 0.0;
    if (!turns_.IsTheRules()) return ceres::SOLVER_CONTINUE;
    num_backoffs_ = 0;
    radius_ = iteration.trust_region_radius;
    fraction_ = scale_;
    switch (ComputeStep(iteration)) {
      case Outcome::kStep:
        Stage();
        return ceres::SOLVER_CONTINUE;
      case Outcome::kNoStep:
        turns_.RuleHadNoStep();
        return ceres::SOLVER_CONTINUE;
      case Outcome::kAnotherState:
        break;
    }
    return Abort(
        "UpdateCallback does not see the solver's state; set "
        "Solver::Options::update_state_every_iteration = true, and let no "
        "other callback change the blocks");
  }

  // Sets step_, or else summary_.message. A rule that needs no linearization is
  // asked first: if it has no step, none is made.
  Outcome ComputeStep(const ceres::IterationSummary& iteration) {
    Linearization at_x;
    at_x.cost = iteration.cost;
    if (needs_linearization_) {
      const Outcome outcome = Linearize(iteration, &at_x);
      if (outcome != Outcome::kStep) return outcome;
    }
    if (!rule_->ComputeStep(at_x, &step_, &summary_.message)) {
      return Outcome::kNoStep;
    }
    CHECK_EQ(step_.size(), linearizer_.num_parameters());
    step_ *= scale_;
    if (!needs_linearization_) {
      const Outcome outcome = Linearize(iteration, &at_x);
      if (outcome != Outcome::kStep) return outcome;
    }
    if (IsPromising(at_x)) return Outcome::kStep;
    summary_.message =
        "the linear model promises too small a decrease of the cost";
    // Perhaps because of the scale, which no other proposal would mend.
    scale_ = std::min(2.0 * scale_, 1.0);
    return Outcome::kNoStep;
  }

  // Of what the rule needs, and of J for the linear model. kStep: there may be
  // one.
  Outcome Linearize(const ceres::IterationSummary& iteration,
                    Linearization* at_x) {
    LinearizationParts parts = rule_->Needs();
    parts.jacobian = true;
    if (!linearizer_.Linearize(parts, at_x, &summary_.message)) {
      return Outcome::kNoStep;
    }
    // The same residual blocks at the same state: the sums differ by rounding.
    // Both contain the fixed cost of residual blocks that cannot change.
    constexpr double kCostTolerance = 1e-9;
    return std::abs(at_x->cost - iteration.cost) <=
                   kCostTolerance * std::abs(iteration.cost)
               ? Outcome::kStep
               : Outcome::kAnotherState;
  }

  // L(x) - L(x + step) by the linear model; false for a NaN too.
  bool IsPromising(const Linearization& at_x) const {
    Eigen::VectorXd J_step;
    at_x.jacobian->Times(step_, &J_step);
    const double decrease =
        -at_x.loss_gradient.dot(J_step) - 0.5 * J_step.squaredNorm();
    return decrease >= options_.min_relative_model_decrease * at_x.cost;
  }

  void BackOff() {
    // A rule that judges its steps remembers it itself.
    if (!rule_->JudgesSteps()) scale_ *= 0.5;
    if (num_backoffs_ >= options_.max_num_backoffs) {
      // Each rejection has shrunk Ceres' trust region, 64 times after three of
      // them. If proposals went on, Ceres' own steps would become so short that
      // its function tolerance ended the run far from a minimum (measured: in
      // Rosenbrock's valley). LM's has recovered after four good steps;
      // dogleg's does not grow beyond what its steps need.
      lost_radius_ = radius_;
      num_turns_lost_ = kMostTurnsLost;
      summary_.message = "the last proposal was rejected " +
                         std::to_string(num_backoffs_ + 1) + " times";
      return;
    }
    ++num_backoffs_;
    step_ *= 0.5;
    fraction_ *= 0.5;
    Stage();
  }

  // Blocks that had no manifold wear theirs only while a step is staged, which
  // spares Ceres products with their Jacobians at its own turns. They must have
  // begun the solve with them: that is when Ceres decides how much memory an
  // evaluation has.
  void SetWrapped(bool wrapped) {
    if (is_wrapped_ == wrapped) return;
    if (!wrapped && ++num_unwraps_ > kMostUnwraps) return;
    is_wrapped_ = wrapped;
    for (std::size_t i = 0; i < own_.size(); ++i) {
      if (own_[i].manifold != nullptr) continue;
      problem_->SetManifold(own_[i].values, wrapped ? staging_[i] : nullptr);
    }
  }

  void Stage() {
    SetWrapped(true);
    for (std::size_t i = 0; i < staging_.size(); ++i) {
      staging_[i]->Stage(step_.data() +
                         linearizer_.column(static_cast<int>(i)));
    }
    has_proposal_ = true;
  }

  ceres::CallbackReturnType Abort(const std::string& message) {
    LOG(ERROR) << message;
    summary_.message = message;
    return ceres::SOLVER_ABORT;
  }

  const Options options_;
  UpdateRule* rule_;
  ceres::Problem* problem_;
  const ProblemLinearizer linearizer_;
  const bool needs_linearization_;         // to compute a step
  std::vector<OwnManifold> own_;           // in the order of the linearizer's
  std::vector<StagingManifold*> staging_;  // blocks, both
  // Those that the problem does not delete.
  std::vector<std::unique_ptr<StagingManifold>> owned_;
  Eigen::VectorXd step_;  // n: the last proposal
  bool has_run_ = false;
  bool is_wrapped_ = true;  // the blocks that had no manifold
  int num_unwraps_ = 0;
  bool has_proposal_ = false;  // staged in the last call
  int num_backoffs_ = 0;       // of the last proposal
  double radius_ = 0.0;        // Ceres', when it was first made
  double scale_ = 1.0;         // of proposals: what was accepted lately
  double fraction_ = 1.0;      // of the rule's step that step_ is
  double lost_radius_ = 0.0;   // Ceres has the turn below it,
  int num_turns_lost_ = 0;     // but no more turns than these
  double cost_ = 0.0;          // at the last accepted state
  TurnTaking turns_;
  Summary summary_;
};

bool UpdateCallback::IsSupported(const Options& options,
                                 const ceres::Problem& problem,
                                 std::string* error) {
  return AreSupported(options, problem, ProblemLinearizer(&problem, {}), error);
}

UpdateCallback::UpdateCallback(const Options& options,
                               UpdateRule* rule,
                               ceres::Problem* problem) {
  CHECK(rule != nullptr);
  CHECK(problem != nullptr);
  state_ = std::make_unique<State>(options, rule, problem);
}

UpdateCallback::UpdateCallback(const Options& options,
                               UpdateRule* rule,
                               CachedProblem* problem)
    : UpdateCallback(WithSharedManifolds(options), rule, problem->problem()) {}

UpdateCallback::~UpdateCallback() = default;

ceres::CallbackReturnType UpdateCallback::operator()(
    const ceres::IterationSummary& iteration) {
  return state_->OnIteration(iteration);
}

UpdateCallback::Summary UpdateCallback::summary() const {
  return state_->summary();
}

std::string UpdateCallback::Summary::BriefReport() const {
  return std::to_string(num_proposed) + " proposed, " +
         std::to_string(num_accepted) + " accepted, " +
         std::to_string(num_rejected) + " rejected, " +
         std::to_string(num_ceres_steps) + " steps of Ceres";
}

}  // namespace invgrad
