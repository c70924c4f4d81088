#include "invgrad/solve/update_callback.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "Eigen/Core"
#include "ceres/local_parameterization.h"
#include "ceres/manifold.h"
#include "glog/logging.h"
#include "invgrad/linalg/linearization.h"
#include "invgrad/solve/problem_linearizer.h"

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
  OwnManifold(const ceres::Problem& problem, double* values)
      : values(values),
        manifold(problem.GetManifold(values)),
        parameterization(problem.GetParameterization(values)) {}

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

bool IsBounded(const ceres::Problem& problem, const double* values) {
  // "If the parameter is not bounded by the user" (ceres/problem.h).
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  const int size = problem.ParameterBlockSize(values);
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
  const auto name = [](std::size_t i) {
    return "parameter block " + std::to_string(i) + " (of those not constant)";
  };
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const int size = problem.ParameterBlockTangentSize(blocks[i]);
    if (size > options.max_block_size) {
      *error = name(i) + " has size " + std::to_string(size) + " > " +
               std::to_string(options.max_block_size) +
               " = max_block_size; split it into smaller blocks, or use "
               "Minimize";
      return false;
    }
    if (IsBounded(problem, blocks[i])) {
      *error = name(i) +
               " has bounds, with which proposals do not work; remove the "
               "bounds (a change of variables can take their place), or solve "
               "without UpdateCallback";
      return false;
    }
  }
  return true;
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
        parts_(rule->Needs()) {
    std::string error;
    CHECK(AreSupported(options_, *problem, linearizer_, &error)) << error;
    parts_.jacobian = true;  // for the linear model
    for (double* values : linearizer_.parameter_blocks()) {
      own_.emplace_back(*problem, values);
      staging_.push_back(new StagingManifold(
          problem->ParameterBlockSize(values), own_.back().manifold));
      if (options_.manifold_ownership == ceres::DO_NOT_TAKE_OWNERSHIP) {
        owned_.emplace_back(staging_.back());
      }
      problem->SetManifold(values, staging_.back());
    }
  }

  ~State() {
    for (const OwnManifold& own : own_) own.Restore(problem_);
  }

  ceres::CallbackReturnType OnIteration(
      const ceres::IterationSummary& iteration) {
    if (iteration.iteration == 0) {
      summary_ = Summary();
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
    if (was_proposed && iteration.iteration > 0 && rule_->JudgesSteps()) {
      // Whatever the rule thinks of it, Ceres has decided.
      rule_->KeepsStep(iteration.cost, fraction_);
    }
    for (StagingManifold* manifold : staging_) manifold->Clear();
    has_proposal_ = false;

    if (iteration.iteration == 0) {
      scale_ = 1.0;
      lost_radius_ = 0.0;
      num_turns_left_ = 0;
      turns_after_failure_ = kMinTurns;
      return Propose(iteration);
    }
    if (iteration.step_is_successful) {
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

  Summary summary() const {
    Summary summary = summary_;
    // Ceres ends a run on its tolerances without calling anyone back.
    if (has_proposal_ && !IsStaged()) ++summary.num_proposed;
    return summary;
  }

 private:
  // Blocks that residual blocks name come first, and Ceres moves them all or
  // none.
  bool IsStaged() const {
    return !staging_.empty() && staging_.front()->is_staged();
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
    if (iteration.trust_region_radius < lost_radius_) {
      summary_.message =
          "Ceres' trust region has not recovered from a rejected proposal";
      return ceres::SOLVER_CONTINUE;
    }
    lost_radius_ = 0.0;
    if (num_turns_left_ > 0) {
      // The message stays that of the failure.
      --num_turns_left_;
      return ceres::SOLVER_CONTINUE;
    }
    Linearization at_x;
    if (!linearizer_.Linearize(parts_, &at_x, &summary_.message)) {
      return ceres::SOLVER_CONTINUE;
    }
    // The same residual blocks at the same state: the sums differ by rounding.
    // Both contain the fixed cost of residual blocks that cannot change.
    constexpr double kCostTolerance = 1e-9;
    if (!(std::abs(at_x.cost - iteration.cost) <=
          kCostTolerance * std::abs(iteration.cost))) {
      return Abort(
          "UpdateCallback does not see the solver's state; set "
          "Solver::Options::update_state_every_iteration = true, and let no "
          "other callback change the blocks");
    }
    num_backoffs_ = 0;
    radius_ = iteration.trust_region_radius;
    if (!rule_->ComputeStep(at_x, &step_, &summary_.message)) {
      num_turns_left_ = turns_after_failure_;
      turns_after_failure_ = std::min(2 * turns_after_failure_, kMaxTurns);
      return ceres::SOLVER_CONTINUE;
    }
    turns_after_failure_ = kMinTurns;
    CHECK_EQ(step_.size(), linearizer_.num_parameters());
    step_ *= scale_;
    fraction_ = scale_;
    if (!IsPromising(at_x)) {
      summary_.message =
          "the linear model promises too small a decrease of the cost";
      return ceres::SOLVER_CONTINUE;
    }
    Stage();
    return ceres::SOLVER_CONTINUE;
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
      // Rosenbrock's valley).
      lost_radius_ = radius_;
      summary_.message = "the last proposal was rejected " +
                         std::to_string(num_backoffs_ + 1) + " times";
      return;
    }
    ++num_backoffs_;
    step_ *= 0.5;
    fraction_ *= 0.5;
    Stage();
  }

  void Stage() {
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

  // A rule that fails is asked again after so many turns of Ceres', and twice
  // as many each time that it fails again.
  static constexpr int kMinTurns = 2;
  static constexpr int kMaxTurns = 16;

  const Options options_;
  UpdateRule* rule_;
  ceres::Problem* problem_;
  const ProblemLinearizer linearizer_;
  LinearizationParts parts_;
  std::vector<OwnManifold> own_;           // in the order of the linearizer's
  std::vector<StagingManifold*> staging_;  // blocks, both
  // Those that the problem does not delete.
  std::vector<std::unique_ptr<StagingManifold>> owned_;
  Eigen::VectorXd step_;       // n: the last proposal
  bool has_proposal_ = false;  // staged in the last call
  int num_backoffs_ = 0;       // of the last proposal
  double radius_ = 0.0;        // Ceres', when it was first made
  double scale_ = 1.0;         // of proposals: what was accepted lately
  double fraction_ = 1.0;      // of the rule's step that step_ is
  double lost_radius_ = 0.0;   // Ceres has the turn below it
  int num_turns_left_ = 0;     // of Ceres', before the rule is asked again
  int turns_after_failure_ = kMinTurns;
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
