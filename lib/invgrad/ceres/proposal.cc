#include "invgrad/ceres/proposal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/hessian_times.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

constexpr char kNoChange[] = "the candidate is the current state";

// Two sums of the same residual blocks differ by rounding.
bool AreEqual(double cost, double other) {
  constexpr double kCostTolerance = 1e-9;
  return std::abs(cost - other) <= kCostTolerance * std::abs(other);
}

}  // namespace

LinearizationParts Proposer::Needs() const {
  return rule == nullptr ? LinearizationParts() : rule->Needs();
}

Proposal::Proposal(double min_relative_model_decrease,
                   const Proposer& proposer,
                   const Bounds* bounds,
                   const ceres::Problem& problem,
                   ProblemLinearizer* linearizer,
                   WorkLimit* work)
    : min_relative_model_decrease_(min_relative_model_decrease),
      proposer_(proposer),
      judge_(proposer.rule == nullptr ? nullptr : proposer.rule->judge()),
      bounds_(*bounds),
      linearizer_(*linearizer),
      work_(*work),
      parts_(proposer.Needs()),
      needs_linearization_(parts_.gradient || parts_.jacobian ||
                           parts_.hessian) {
  parts_.jacobian = true;
  if (proposer_.rule != nullptr) return;
  auto offsets = std::make_shared<ProblemState::Offsets>();
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  for (const double* block : blocks) offsets->emplace(block, -1);
  for (const auto& block : linearizer_.structure().parameter_blocks) {
    (*offsets)[block.values] = block.offset;
  }
  offsets_ = std::move(offsets);
}

bool Proposal::ComputeStep(double cost,
                           const Eigen::VectorXd& state,
                           std::string* message) {
  cost_ = cost;
  state_ = state;
  num_withheld_ = 0;
  num_outside_domain_ = 0;
  fraction_ = scale_;
  return proposer_.rule != nullptr ? StepOfRule(message)
                                   : StepOfFunction(message);
}

bool Proposal::StepOfFunction(std::string* message) {
  const ProblemState x(offsets_, state_);
  ProblemState candidate = x;
  const bool has_candidate = proposer_.function(x, &candidate);
  linearizer_.SetState(state_);
  work_.CountStep();
  if (has_candidate) return IntoTangentSpace(candidate.values(), message);
  *message = "the proposal function has no candidate";
  return false;
}

bool Proposal::IntoTangentSpace(const Eigen::VectorXd& candidate,
                                std::string* message) {
  constexpr double kOffManifold = 1e-6;
  const ProblemStructure& structure = linearizer_.structure();
  step_.setZero(structure.num_parameters);
  int i = -1;
  for (const auto& block : structure.parameter_blocks) {
    ++i;
    const auto to = candidate.segment(block.offset, block.ambient_size);
    const auto from = state_.segment(block.offset, block.ambient_size);
    const auto fail = [&](const char* why) {
      *message = fmt::format(
          "the candidate of parameter block {} (of those that are not "
          "constant) {}",
          i,
          why);
      return false;
    };
    if (!to.allFinite()) return fail("is not finite");
    auto step = step_.segment(block.column, block.tangent_size);
    if (block.manifold == nullptr) {
      step = to - from;
      continue;
    }
    Eigen::VectorXd reached(block.ambient_size);
    if (to == from) continue;
    if (!block.manifold->Minus(to.data(), from.data(), step.data()) ||
        !step.allFinite() ||
        !block.manifold->Plus(from.data(), step.data(), reached.data()) ||
        !((reached - to).norm() <= kOffManifold * (from.norm() + to.norm()))) {
      return fail("is not on its manifold");
    }
  }
  if (!step_.isZero(0.0)) return true;
  *message = kNoChange;
  return false;
}

// For a rule that needs no linearization, linearizes the problem only if there
// is a step.
bool Proposal::StepOfRule(std::string* message) {
  Linearization at_x;
  at_x.cost = cost_;
  if (needs_linearization_ && !Linearize(&at_x, message)) return false;
  work_.CountStep();
  if (parts_.hessian_times || parts_.after) {
    AddProductsAndTrials(parts_, state_, AfterOf(&linearizer_), &at_x);
    work_.CountLinearization();
    work_.CountLinearization();
  }
  if (!proposer_.rule->ComputeStep(at_x, &step_, message)) return false;
  CHECK_EQ(step_.size(), linearizer_.num_parameters());
  step_ *= scale_;
  if (!needs_linearization_ && !Linearize(&at_x, message)) return false;
  if (IsPromising(at_x)) return true;
  *message = "the linear model predicts too small a decrease of the cost";
  // The scale may be too small, and only a proposal can raise it.
  DoubleScale();
  return false;
}

bool Proposal::Linearize(Linearization* at_x, std::string* message) {
  if (candidate_.size() > 0 && candidate_ == state_ &&
      AreEqual(at_candidate_.cost, cost_)) {
    *at_x = std::move(at_candidate_);
    candidate_.resize(0);
    return true;
  }
  work_.CountLinearization();
  if (!linearizer_.Linearize(parts_, at_x, message)) return false;
  is_another_state_ = !AreEqual(at_x->cost, cost_);
  return !is_another_state_;
}

// Whether the linear model predicts a large enough L(x) - L(x + step); false
// for NaN.
bool Proposal::IsPromising(const Linearization& at_x) const {
  Eigen::VectorXd J_step;
  at_x.jacobian->Times(step_, &J_step);
  const double decrease =
      -at_x.loss_gradient.dot(J_step) - 0.5 * J_step.squaredNorm();
  return decrease >= min_relative_model_decrease_ * at_x.cost;
}

bool Proposal::FindCandidate(const std::function<bool(double cost)>& may_end,
                             std::string* message) {
  constexpr int kMaxNumHalvings = 2;
  for (;; step_ *= 0.5, fraction_ *= 0.5) {
    double cost = std::numeric_limits<double>::quiet_NaN();
    std::string error;
    bool is_in_domain = MoveTo(step_);
    if (is_in_domain) {
      candidate_ = linearizer_.State();
      if (candidate_ == state_) {  // the bounds, or rounding
        candidate_.resize(0);
        *message = kNoChange;
        return false;
      }
      work_.CountLinearization();
      is_in_domain = linearizer_.Linearize(parts_, &at_candidate_, &error);
      if (is_in_domain && CanContinueFromCandidate(may_end)) {
        cost = at_candidate_.cost;
      }
    }
    if (!is_in_domain && num_outside_domain_++ == 0) step_outside_ = step_;
    linearizer_.SetState(state_);
    if (cost <= cost_) return true;
    if (judge_ != nullptr) {
      judge_->KeepsStep(cost, fraction_);
    } else {
      HalveScale();
    }
    if (num_withheld_++ == kMaxNumHalvings) break;
  }
  candidate_.resize(0);
  *message = fmt::format("no lower cost by the last proposal, {} times",
                         num_withheld_);
  return false;
}

bool Proposal::CanContinueFromCandidate(
    const std::function<bool(double cost)>& may_end) const {
  constexpr double kFlat = 1e-10;
  // Ceres' gradient is x - Plus(x, -gradient).
  constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
  const JacobianOperator& J = *at_candidate_.jacobian;
  const double cost = at_candidate_.cost;
  Eigen::VectorXd gradient;
  J.TransposeTimes(at_candidate_.loss_gradient, &gradient);
  // Equal elements would be a gauge freedom of many problems.
  Eigen::VectorXd d(J.cols());
  for (Eigen::Index i = 0; i < d.size(); ++i) {
    d[i] = 1.0 + 0.5 * std::sin(static_cast<double>(i + 1));
  }
  Eigen::VectorXd J_d;
  Eigen::VectorXd squares;
  J.Times(d, &J_d);
  J.TransposeTimes(J_d, &squares);
  if (!gradient.allFinite() || !squares.allFinite()) return false;
  const double size = std::max(candidate_.norm(), step_.norm());
  const bool is_stationary = gradient.norm() * size < kFlat * cost;
  if (is_stationary && J_d.norm() * size < kFlat * std::sqrt(2.0 * cost)) {
    return false;
  }
  return !(is_stationary || gradient.norm() <= kRounding * candidate_.norm()) ||
         may_end(cost);
}

void Proposal::Decided(bool is_accepted, double cost) {
  // The result of KeepsStep is not used.
  if (judge_ != nullptr) {
    judge_->KeepsStep(cost, fraction_);
  } else if (!is_accepted) {
    HalveScale();
  }
  if (is_accepted) DoubleScale();
}

bool Proposal::MoveTo(const Eigen::VectorXd& step) {
  if (!linearizer_.Plus(step)) return false;
  if (bounds_.any()) {
    Eigen::VectorXd state = linearizer_.State();
    bounds_.Project(&state);
    linearizer_.SetState(state);
  }
  return true;
}

void Proposal::HalveScale() {
  if (proposer_.rule != nullptr) scale_ *= 0.5;
}

void Proposal::DoubleScale() { scale_ = std::min(2.0 * scale_, 1.0); }

}  // namespace invgrad
