#include "invgrad/ceres/domain_failure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

#include "ceres/manifold.h"
#include "fmt/core.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Reason = DomainFailure::Reason;

const char* ReasonText(Reason reason) {
  switch (reason) {
    case Reason::kPlus:
      return "Plus returned false";
    case Reason::kReturned:
      return "cost function returned false";
    case Reason::kResidual:
      return "a residual is not finite";
    case Reason::kCost:
      return "the cost is not finite";
    case Reason::kJacobian:
      break;
  }
  return "the Jacobian is not finite";
}

std::string BlockName(const DomainFailure::Options& options,
                      const ProblemStructure& structure,
                      int block) {
  std::string name;
  if (options.block_name) {
    name = options.block_name(structure.parameter_blocks[block].values);
  }
  return name.empty() ? fmt::format("block {}", block) : name;
}

// Evaluates residual blocks at states between a good and a bad one.
class DomainSearch {
 public:
  DomainSearch(const DomainFailure::Options& options,
               const ProblemStructure& structure,
               const Eigen::VectorXd& good,
               const Eigen::VectorXd& bad)
      : options_(options), structure_(structure), good_(good), bad_(bad) {}

  bool Explain(DomainFailure* failure) {
    *failure = DomainFailure();
    for (const bool with_jacobians : {false, true}) {
      SetAll(bad_, with_jacobians);
      for (const auto& block : structure_.residual_blocks) {
        const std::optional<Reason> reason = Evaluate(block, with_jacobians);
        if (!reason) continue;
        if (failure->num_failing_blocks++ > 0) continue;
        block_ = &block;
        failure->reason = *reason;
        failure->residual_block = block.index;
      }
      if (block_ == nullptr) continue;
      with_jacobians_ = with_jacobians;
      FindParameters(failure);
      return true;
    }
    return false;
  }

 private:
  // Components of a parameter block that return together.
  struct Unit {
    int block;
    int component;  // -1: all
    int offset;     // in the state
    int size;
  };

  void SetAll(const Eigen::VectorXd& state, bool with_jacobians) {
    structure_.SetState(state);
    Prepare(with_jacobians);
  }

  void Prepare(bool with_jacobians) {
    if (options_.evaluation_callback == nullptr) return;
    options_.evaluation_callback->PrepareForEvaluation(
        with_jacobians, /*new_evaluation_point=*/true);
  }

  // Why the residual block cannot be evaluated at the values of its blocks.
  std::optional<Reason> Evaluate(const ProblemStructure::ResidualBlock& block,
                                 bool with_jacobians) {
    r_.resize(block.size);
    double** jacobians = nullptr;
    if (with_jacobians && block.row_length > 0) {
      jacobians_.resize(block.num_arguments);
      pointers_.assign(block.num_arguments, nullptr);
      for (int b = 0; b < block.num_arguments; ++b) {
        const int index = structure_.arguments[block.first_argument + b].block;
        if (index < 0) continue;
        jacobians_[b].setZero(block.size *
                              structure_.parameter_blocks[index].ambient_size);
        pointers_[b] = jacobians_[b].data();
      }
      jacobians = pointers_.data();
    }
    if (!block.cost_function->Evaluate(
            structure_.values.data() + block.first_argument,
            r_.data(),
            jacobians)) {
      return Reason::kReturned;
    }
    if (!r_.allFinite()) return Reason::kResidual;
    double rho[3] = {r_.squaredNorm(), 1.0, 0.0};
    if (block.loss_function != nullptr) {
      block.loss_function->Evaluate(rho[0], rho);
    }
    if (!std::isfinite(rho[0])) return Reason::kCost;
    for (int b = 0; jacobians != nullptr && b < block.num_arguments; ++b) {
      if (jacobians[b] != nullptr && !jacobians_[b].allFinite()) {
        return Reason::kJacobian;
      }
    }
    return std::nullopt;
  }

  // The parameters of the residual block that differ between the states.
  std::vector<Unit> Units(bool by_component) const {
    std::vector<Unit> units;
    for (int b = 0; b < block_->num_arguments; ++b) {
      const int index = structure_.arguments[block_->first_argument + b].block;
      if (index < 0) continue;
      const auto& block = structure_.parameter_blocks[index];
      const bool varies_alone =
          by_component && (block.manifold == nullptr ||
                           dynamic_cast<const ceres::SubsetManifold*>(
                               block.manifold) != nullptr);
      const int size = varies_alone ? 1 : block.ambient_size;
      for (int i = 0; i < block.ambient_size; i += size) {
        const int offset = block.offset + i;
        if (good_.segment(offset, size) != bad_.segment(offset, size)) {
          units.push_back({index, varies_alone ? i : -1, offset, size});
        }
      }
    }
    return units;
  }

  void Set(const Unit& unit, const Eigen::VectorXd& state) {
    const auto& block = structure_.parameter_blocks[unit.block];
    std::copy_n(state.data() + unit.offset,
                unit.size,
                block.values + (unit.offset - block.offset));
  }

  bool IsOutside() {
    Prepare(with_jacobians_);
    return Evaluate(*block_, with_jacobians_).has_value();
  }

  void FindParameters(DomainFailure* failure) {
    constexpr std::size_t kMaxNumComponents = 1000;
    structure_.SetState(good_);
    if (IsOutside()) {
      failure->fails_at_good_state = true;
      Prepare(/*with_jacobians=*/true);
      failure->only_without_jacobians =
          !with_jacobians_ && !Evaluate(*block_, true).has_value();
      return;
    }
    std::vector<Unit> units = Units(/*by_component=*/true);
    if (units.size() > kMaxNumComponents) units = Units(false);
    std::vector<Unit> found = One(units);
    if (found.empty()) found = Several(units);
    for (const Unit& unit : found) {
      DomainFailure::Parameter parameter;
      parameter.block = unit.block;
      parameter.name = BlockName(options_, structure_, unit.block);
      parameter.component = unit.component;
      const bool is_whole = unit.component < 0;
      const auto value = bad_.segment(unit.offset, unit.size);
      const auto was = good_.segment(unit.offset, unit.size);
      parameter.value = is_whole ? value.norm() : value[0];
      parameter.was = is_whole ? was.norm() : was[0];
      failure->parameters.push_back(std::move(parameter));
    }
  }

  // The one that suffices, or none.
  std::vector<Unit> One(const std::vector<Unit>& units) {
    std::vector<Unit> sufficient;
    structure_.SetState(bad_);
    for (const Unit& unit : units) {
      Set(unit, good_);
      if (!IsOutside()) sufficient.push_back(unit);
      Set(unit, bad_);
    }
    if (sufficient.size() <= 1) return sufficient;
    structure_.SetState(good_);
    for (const Unit& unit : sufficient) {
      Set(unit, bad_);
      const bool leads_outside = IsOutside();
      Set(unit, good_);
      if (leads_outside) return {unit};
    }
    return {sufficient.front()};
  }

  // Of all at their good values, those that are needed.
  std::vector<Unit> Several(const std::vector<Unit>& units) {
    std::vector<Unit> needed;
    structure_.SetState(good_);
    for (const Unit& unit : units) {
      Set(unit, bad_);
      if (!IsOutside()) continue;
      Set(unit, good_);
      needed.push_back(unit);
    }
    return needed;
  }

  const DomainFailure::Options& options_;
  const ProblemStructure& structure_;
  const Eigen::VectorXd& good_;
  const Eigen::VectorXd& bad_;
  const ProblemStructure::ResidualBlock* block_ = nullptr;  // the failing one
  bool with_jacobians_ = false;
  Eigen::VectorXd r_;
  std::vector<Eigen::VectorXd> jacobians_;
  std::vector<double*> pointers_;
};

DomainFailure FailureOfPlus(const DomainFailure::Options& options,
                            const ProblemStructure& structure,
                            int block) {
  DomainFailure failure;
  failure.reason = Reason::kPlus;
  DomainFailure::Parameter parameter;
  parameter.block = block;
  parameter.name = BlockName(options, structure, block);
  failure.parameters.push_back(std::move(parameter));
  return failure;
}

// Forwards to a block's manifold, and notes that its Plus failed.
class PlusWatch final : public ceres::Manifold {
 public:
  explicit PlusWatch(const ceres::Manifold* own) : own_(*own) {}

  int AmbientSize() const override { return own_.AmbientSize(); }
  int TangentSize() const override { return own_.TangentSize(); }
  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override {
    if (own_.Plus(x, delta, x_plus_delta)) return true;
    has_failed_ = true;
    return false;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    return own_.PlusJacobian(x, jacobian);
  }
  bool RightMultiplyByPlusJacobian(const double* x,
                                   const int num_rows,
                                   const double* ambient_matrix,
                                   double* tangent_matrix) const override {
    return own_.RightMultiplyByPlusJacobian(
        x, num_rows, ambient_matrix, tangent_matrix);
  }
  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override {
    return own_.Minus(y, x, y_minus_x);
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    return own_.MinusJacobian(x, jacobian);
  }

  bool has_failed() const { return has_failed_; }

 private:
  const ceres::Manifold& own_;
  // Ceres forms its candidate by one thread.
  mutable bool has_failed_ = false;
};

// Notes the states at which Ceres evaluates, and ends the solve after a
// candidate outside the domain.
class CandidateWatch final : public ceres::EvaluationCallback,
                             public ceres::IterationCallback {
 public:
  CandidateWatch(const ProblemStructure& structure,
                 ceres::EvaluationCallback* users)
      : structure_(structure), users_(users) {}

  void PrepareForEvaluation(bool evaluate_jacobians,
                            bool new_evaluation_point) override {
    if (users_ != nullptr) {
      users_->PrepareForEvaluation(evaluate_jacobians, new_evaluation_point);
    }
    candidate_ = structure_.State();
    if (!evaluate_jacobians) return;
    last_ = std::move(linearized_);
    linearized_ = candidate_;
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    if (!IsOutsideDomain(iteration)) return ceres::SOLVER_CONTINUE;
    last_ = linearized_;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  // After the solve. If that failed at its start, the good state is the bad one.
  const Eigen::VectorXd& good() const {
    return last_.size() > 0 ? last_ : candidate_;
  }
  const Eigen::VectorXd& bad() const { return candidate_; }

 private:
  const ProblemStructure& structure_;
  ceres::EvaluationCallback* const users_;
  Eigen::VectorXd candidate_;   // of the last evaluation
  Eigen::VectorXd linearized_;  // of the last one with Jacobians
  Eigen::VectorXd last_;        // of the one before that, or of a failure
};

}  // namespace

bool IsOutsideDomain(const ceres::IterationSummary& iteration) {
  // Ceres' cost of a candidate that it cannot evaluate is the largest number.
  return iteration.iteration > 0 && !iteration.step_is_successful &&
         !(iteration.cost < std::numeric_limits<double>::max());
}

bool ExplainDomainFailure(const DomainFailure::Options& options,
                          const ProblemStructure& structure,
                          const Eigen::VectorXd& good_state,
                          const Eigen::VectorXd& bad_state,
                          DomainFailure* failure) {
  CHECK(failure != nullptr);
  const Eigen::VectorXd state = structure.State();
  const bool is_outside =
      DomainSearch(options, structure, good_state, bad_state).Explain(failure);
  structure.SetState(state);
  return is_outside;
}

bool ExplainFailingStep(const DomainFailure::Options& options,
                        const ProblemStructure& structure,
                        const Eigen::VectorXd& step,
                        DomainFailure* failure) {
  CHECK(failure != nullptr);
  CHECK_EQ(step.size(), structure.num_parameters);
  const Eigen::VectorXd good = structure.State();
  Eigen::VectorXd bad = good;
  int num_failing_blocks = 0;
  for (std::size_t b = 0; b < structure.parameter_blocks.size(); ++b) {
    const auto& block = structure.parameter_blocks[b];
    if (block.manifold == nullptr) {
      bad.segment(block.offset, block.ambient_size) +=
          step.segment(block.column, block.tangent_size);
    } else if (!block.manifold->Plus(block.values,
                                     step.data() + block.column,
                                     bad.data() + block.offset) &&
               num_failing_blocks++ == 0) {
      *failure = FailureOfPlus(options, structure, static_cast<int>(b));
    }
  }
  if (num_failing_blocks > 0) {
    failure->num_failing_blocks = num_failing_blocks;
    return true;
  }
  return ExplainDomainFailure(options, structure, good, bad, failure);
}

bool FindDomainFailure(const ceres::Solver::Options& solver_options,
                       const DomainFailure::Options& options,
                       const ceres::Problem& problem,
                       DomainFailure* failure) {
  return FindDomainFailure(
      solver_options, options, ReadStructure(problem, {}), problem, failure);
}

bool FindDomainFailure(const ceres::Solver::Options& solver_options,
                       const DomainFailure::Options& options,
                       const ProblemStructure& structure,
                       const ceres::Problem& problem,
                       DomainFailure* failure) {
  CHECK(failure != nullptr);
  if (solver_options.minimizer_type != ceres::TRUST_REGION) return false;
  std::unordered_map<const double*, int> index_of;
  std::vector<std::unique_ptr<PlusWatch>> plus_watches;
  for (const auto& block : structure.parameter_blocks) {
    index_of[block.values] = static_cast<int>(plus_watches.size());
    plus_watches.push_back(block.manifold == nullptr
                               ? nullptr
                               : std::make_unique<PlusWatch>(block.manifold));
  }
  CandidateWatch watch(structure, options.evaluation_callback);
  const Eigen::VectorXd start = structure.State();
  {
    ceres::Problem copy(CopyOptions(ceres::DO_NOT_TAKE_OWNERSHIP, &watch));
    CopyProblem(
        problem,
        [](const ceres::CostFunction* function) {
          return const_cast<ceres::CostFunction*>(function);
        },
        [&](const double* values) -> const ceres::Manifold* {
          const auto found = index_of.find(values);
          return found == index_of.end() ? nullptr
                                         : plus_watches[found->second].get();
        },
        &copy);
    ceres::Solver::Options repeated = solver_options;
    repeated.callbacks = {&watch};
    repeated.minimizer_progress_to_stdout = false;
    repeated.logging_type = ceres::SILENT;
    repeated.update_state_every_iteration = false;
    repeated.use_inner_iterations = false;
    repeated.trust_region_minimizer_iterations_to_dump.clear();
    ceres::Solver::Summary summary;
    ceres::Solve(repeated, &copy, &summary);
  }
  structure.SetState(start);
  for (std::size_t b = 0; b < plus_watches.size(); ++b) {
    if (plus_watches[b] != nullptr && plus_watches[b]->has_failed()) {
      *failure = FailureOfPlus(options, structure, static_cast<int>(b));
      failure->num_failing_blocks = 1;
      return true;
    }
  }
  return watch.bad().size() > 0 &&
         ExplainDomainFailure(
             options, structure, watch.good(), watch.bad(), failure);
}

std::string DomainFailure::ToText() const {
  constexpr std::size_t kMaxNumParameters = 5;
  std::string text;
  if (residual_block >= 0) {
    text = fmt::format(
        "residual block {} ({})", residual_block, ReasonText(reason));
    if (fails_at_good_state) {
      text += ": the good state lies outside, too";
      if (only_without_jacobians) {
        text += ", if no Jacobians are requested (jacobians = nullptr)";
      }
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (i == kMaxNumParameters) {
      text += fmt::format(" and {} more", parameters.size() - i);
      break;
    }
    const Parameter& parameter = parameters[i];
    if (i > 0) {
      text += ", ";
    } else {
      text += fmt::format("{}parameter ", text.empty() ? "" : ": ");
    }
    text += '`' + parameter.name + '`';
    if (reason == Reason::kPlus) {
      text += fmt::format(" ({})", ReasonText(reason));
    } else if (parameter.component < 0) {
      text += fmt::format(
          " of norm {:.3g} (was {:.3g})", parameter.value, parameter.was);
    } else {
      text += fmt::format("[{}] = {:.3g} (was {:.3g})",
                          parameter.component,
                          parameter.value,
                          parameter.was);
    }
  }
  if (residual_block >= 0 && num_failing_blocks > 1) {
    text += fmt::format("; {} other residual blocks fail, too",
                        num_failing_blocks - 1);
  }
  return text;
}

}  // namespace invgrad
