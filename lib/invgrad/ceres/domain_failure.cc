#include "invgrad/ceres/domain_failure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "ceres/manifold.h"
#include "fmt/core.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/internal/invalid_start.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Reason = DomainFailure::Reason;

std::string BlockName(const DomainFailure::Options& options,
                      const ProblemStructure& structure,
                      int block) {
  std::string name;
  if (options.block_name) {
    name = options.block_name(structure.parameter_blocks[block].values);
  }
  return name.empty() ? fmt::format("block {}", block) : name;
}

// Evaluates residual blocks at states between a good and a bad one. Leaves the
// parameter blocks at one of these.
class DomainSearch {
 public:
  DomainSearch(const DomainFailure::Options& options,
               const ProblemStructure& structure,
               const Eigen::VectorXd& good,
               const Eigen::VectorXd& bad)
      : options_(options), structure_(structure), good_(good), bad_(bad) {}

  // False if no residual block fails at the bad state.
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

  // After Explain, and after a change of the good state: the parameters that
  // mend the failing residual block, or none if that state fails, too.
  std::vector<DomainFailure::Parameter> Parameters() {
    DomainFailure failure;
    FindParameters(&failure);
    return std::move(failure.parameters);
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

// Records the first step of a solve.
class FirstStep final : public ceres::IterationCallback {
 public:
  FirstStep(StagedStep* staged, Eigen::VectorXd* step)
      : staged_(*staged), step_(*step) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    // Ceres has called Plus for the gradient.
    if (iteration.iteration == 0) staged_.Record(step_.data());
    return ceres::SOLVER_CONTINUE;
  }

 private:
  StagedStep& staged_;
  Eigen::VectorXd& step_;
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
                        const Bounds& bounds,
                        const Eigen::VectorXd& step,
                        DomainFailure* failure) {
  CHECK(failure != nullptr);
  Eigen::VectorXd bad;
  const std::vector<int> failing = structure.Plus(step, &bad);
  if (failing.empty()) {
    bounds.Project(&bad);
    return ExplainDomainFailure(
        options, structure, structure.State(), bad, failure);
  }
  *failure = DomainFailure();
  failure->reason = Reason::kPlus;
  failure->num_failing_blocks = static_cast<int>(failing.size());
  DomainFailure::Parameter parameter;
  parameter.block = failing.front();
  parameter.name = BlockName(options, structure, parameter.block);
  failure->parameters.push_back(std::move(parameter));
  return true;
}

bool ExplainInvalidStart(const DomainFailure::Options& options,
                         const ProblemStructure& structure,
                         DomainFailure* failure) {
  CHECK(failure != nullptr);
  const Eigen::VectorXd start = structure.State();
  Eigen::VectorXd good = start;
  DomainSearch search(options, structure, good, start);
  const bool is_outside = search.Explain(failure);
  structure.SetState(start);
  if (!is_outside) return false;
  failure->is_start = true;
  const auto block =
      std::find_if(structure.residual_blocks.begin(),
                   structure.residual_blocks.end(),
                   [failure](const auto& candidate) {
                     return candidate.index == failure->residual_block;
                   });
  int num_tried = 0;
  constexpr int kMaxNumTried = 50;
  for (int a = 0; a < block->num_arguments; ++a) {
    const int index = structure.arguments[block->first_argument + a].block;
    if (index < 0) continue;
    const auto& parameters = structure.parameter_blocks[index];
    num_tried += parameters.ambient_size;
    if (parameters.manifold != nullptr || num_tried > kMaxNumTried) continue;
    const auto has_value = [&](int j, double value) {
      good = start;
      good[parameters.offset + j] = value;
      failure->parameters = search.Parameters();
      structure.SetState(start);
      return !failure->parameters.empty();
    };
    double valid_value = 0.0;
    if (FindInvalidParameter(parameters.values,
                             parameters.ambient_size,
                             has_value,
                             &valid_value) >= 0) {
      break;
    }
  }
  return true;
}

bool ExplainNextStep(const ceres::Solver::Options& solver_options,
                     const DomainFailure::Options& options,
                     const ProblemStructure& structure,
                     const ceres::Problem& problem,
                     DomainFailure* failure) {
  CHECK(failure != nullptr);
  // Ceres multiplies J by a square matrix of the size of each wrapped block.
  constexpr int kMaxBlockSize = 512;
  const bool has_large_block =
      std::any_of(structure.tangent_sizes.begin(),
                  structure.tangent_sizes.end(),
                  [](int size) { return size > kMaxBlockSize; });
  if (solver_options.minimizer_type != ceres::TRUST_REGION || has_large_block) {
    return false;
  }
  const Eigen::VectorXd start = structure.State();
  Eigen::VectorXd step = Eigen::VectorXd::Zero(structure.num_parameters);
  ceres::Problem copy =
      CopyProblem(problem, structure, options.evaluation_callback);
  {
    StagedStep staged(structure, ceres::DO_NOT_TAKE_OWNERSHIP, &copy);
    FirstStep first_step(&staged, &step);
    ceres::Solver::Options one_step = UnwatchedOptions(solver_options);
    one_step.callbacks = {&first_step};
    one_step.use_inner_iterations = false;
    one_step.max_num_iterations = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(one_step, &copy, &summary);
  }
  structure.SetState(start);
  const Bounds bounds(problem, structure);
  // Within a solve Ceres scales J as at its start, and the step may be longer.
  for (const double factor : {1.0, 2.0}) {
    if (ExplainFailingStep(
            options, structure, bounds, factor * step, failure)) {
      return true;
    }
  }
  return false;
}

}  // namespace invgrad
