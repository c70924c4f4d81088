#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/ceres/residual_evaluation.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/union_find.h"
#include "invgrad/internal/logging.h"
#include "invgrad/separable.h"
#include "invgrad/separable/affine_check.h"
#include "invgrad/separable/reduced_cost.h"

namespace invgrad {

class SeparableProblem::Builder {
 public:
  Builder(const ceres::Problem& problem, SeparableProblem* result)
      : problem_(problem),
        structure_(ReadStructure(problem, {})),
        result_(result),
        is_in_component_(structure_.residual_blocks.size(), false) {
    for (std::size_t b = 0; b < structure_.parameter_blocks.size(); ++b) {
      index_[structure_.parameter_blocks[b].values] = static_cast<int>(b);
    }
  }

  bool Build(const std::vector<LinearBlock>& linear, std::string* error) {
    if (!std::all_of(linear.begin(), linear.end(), [&](const auto& block) {
          return AddLinear(block, error);
        })) {
      return false;
    }
    const std::vector<std::vector<int>> components = FindComponents();
    for (const std::vector<int>& component : components) {
      if (!AddComponent(component, error)) return false;
    }
    if (!FitsInMemory("the reduced problem",
                      {{"J", J_bytes_}, {"a component", component_bytes_}},
                      /*limit=*/0.0,
                      error)) {
      return false;
    }
    AddResidualBlocks();
    AddParameterBlocks();
    return true;
  }

 private:
  bool AddLinear(const LinearBlock& linear, std::string* error) {
    double* const values = linear.values;
    CHECK(problem_.HasParameterBlock(values))
        << "a linear block is not part of the problem";
    if (problem_.IsParameterBlockConstant(values)) return true;
    const std::string name = result_->BlockName(values, index_.at(values));
    const int size = problem_.ParameterBlockSize(values);
    if (problem_.GetManifold(values) != nullptr) {
      *error = fmt::format(
          "{} is linear and has a manifold; leave it out of the linear "
          "parameters, or put those in a block without manifold",
          name);
      return false;
    }
    std::vector<int> components = linear.components;
    if (components.empty()) {
      components.resize(size);
      std::iota(components.begin(), components.end(), 0);
    }
    std::vector<bool>& is_linear = is_linear_[values];
    is_linear.resize(size);
    constexpr double kNoBound = std::numeric_limits<double>::max();
    for (const int i : components) {
      CHECK(i >= 0 && i < size) << name << " has no component " << i;
      CHECK(!is_linear[i]) << name << "[" << i << "] is named twice";
      is_linear[i] = true;
      if (problem_.GetParameterLowerBound(values, i) > -kNoBound ||
          problem_.GetParameterUpperBound(values, i) < kNoBound) {
        *error = fmt::format(
            "linear parameter {}[{}] has bounds; leave it out of the linear "
            "parameters (Ceres then keeps its bounds), or remove them",
            name,
            i);
        return false;
      }
    }
    result_->num_linear_ += static_cast<int>(components.size());
    return true;
  }

  // The indices of residual blocks that share linear blocks, directly or by
  // others; in the order of their first ones.
  std::vector<std::vector<int>> FindComponents() const {
    const int count = static_cast<int>(structure_.residual_blocks.size());
    UnionFind sets(structure_.residual_blocks.size());
    std::unordered_map<const double*, int> first;
    std::vector<bool> has_linear(count, false);
    for (int i = 0; i < count; ++i) {
      for (double* values : Arguments(i)) {
        if (is_linear_.count(values) == 0) continue;
        has_linear[i] = true;
        sets.Join(first.try_emplace(values, i).first->second, i);
      }
    }
    std::vector<std::vector<int>> members(count);
    for (int i = 0; i < count; ++i) {
      if (has_linear[i]) members[sets.Find(i)].push_back(i);
    }
    members.erase(std::remove_if(members.begin(),
                                 members.end(),
                                 [](const auto& m) { return m.empty(); }),
                  members.end());
    return members;
  }

  std::vector<double*> Arguments(int i) const {
    const auto& block = structure_.residual_blocks[i];
    const auto begin = structure_.values.begin() + block.first_argument;
    return {begin, begin + block.num_arguments};
  }

  bool AddComponent(const std::vector<int>& members, std::string* error) {
    ComponentResiduals residuals;
    std::unordered_map<const double*, int> blocks;
    for (const int i : members) {
      const auto& block = structure_.residual_blocks[i];
      std::vector<int> arguments;
      for (double* values : Arguments(i)) {
        const auto [it, is_new] = blocks.try_emplace(values, 0);
        if (is_new) {
          const auto index = index_.find(values);
          const auto linear = is_linear_.find(values);
          it->second = residuals.AddBlock(
              values,
              problem_.ParameterBlockSize(values),
              index == index_.end() ? -1 : index->second,
              linear == is_linear_.end() ? std::vector<bool>()
                                         : linear->second);
        }
        arguments.push_back(it->second);
      }
      residuals.AddResidualBlock(
          block.cost_function, block.loss_function, block.index, arguments);
      is_in_component_[i] = true;
    }
    if (residuals.has_loss() && result_->options_.is_golub_pereyra) {
      *error = ResidualBlockMessage(
          structure_.residual_blocks[members[0]].index,
          "the Jacobian of Golub and Pereyra is not known with a loss function "
          "in its component; take Kaufman's");
      return false;
    }
    const double m = residuals.num_residuals();
    J_bytes_ += 3.0 * sizeof(double) * m * residuals.num_columns();
    component_bytes_ = std::max(
        component_bytes_,
        sizeof(double) * m *
            (2.0 * residuals.num_columns() + 4.0 * residuals.num_linear()));
    result_->costs_.push_back(
        std::make_unique<ReducedCost>(std::move(residuals),
                                      result_->options_.rank_threshold,
                                      result_->options_.is_golub_pereyra));
    return true;
  }

  void AddResidualBlocks() {
    ceres::Problem* const reduced = &result_->reduced_;
    for (const auto& cost : result_->costs_) {
      std::vector<double*> arguments;
      for (const int b : cost->residuals().arguments()) {
        arguments.push_back(cost->residuals().blocks()[b].values);
      }
      if (arguments.empty()) arguments.push_back(&result_->constant_);
      reduced->AddResidualBlock(cost.get(), nullptr, arguments);
    }
    if (reduced->HasParameterBlock(&result_->constant_)) {
      reduced->SetParameterBlockConstant(&result_->constant_);
    }
    for (std::size_t i = 0; i < structure_.residual_blocks.size(); ++i) {
      if (is_in_component_[i]) continue;
      const auto& block = structure_.residual_blocks[i];
      // A problem that owns no functions does not change them.
      reduced->AddResidualBlock(
          const_cast<ceres::CostFunction*>(block.cost_function),
          const_cast<ceres::LossFunction*>(block.loss_function),
          Arguments(static_cast<int>(i)));
    }
  }

  void AddParameterBlocks() {
    std::vector<double*> blocks;
    problem_.GetParameterBlocks(&blocks);
    for (double* values : blocks) {
      const ceres::Manifold* manifold = problem_.GetManifold(values);
      const auto linear = is_linear_.find(values);
      if (linear != is_linear_.end()) {
        const std::vector<int> constant = Numbers(linear->second);
        if (constant.size() == linear->second.size()) continue;
        result_->manifolds_.push_back(std::make_unique<ceres::SubsetManifold>(
            static_cast<int>(linear->second.size()), constant));
        manifold = result_->manifolds_.back().get();
      }
      CopyParameterBlock(problem_, values, manifold, &result_->reduced_);
    }
  }

  static std::vector<int> Numbers(const std::vector<bool>& is_linear) {
    std::vector<int> numbers;
    for (std::size_t i = 0; i < is_linear.size(); ++i) {
      if (is_linear[i]) numbers.push_back(static_cast<int>(i));
    }
    return numbers;
  }

  const ceres::Problem& problem_;
  const ProblemStructure structure_;
  SeparableProblem* const result_;
  std::unordered_map<const double*, int> index_;  // of structure_'s blocks
  std::unordered_map<const double*, std::vector<bool>> is_linear_;
  std::vector<bool> is_in_component_;  // each residual block
  double J_bytes_ = 0.0;
  double component_bytes_ = 0.0;  // of the largest
};

SeparableProblem::SeparableProblem(const Options& options)
    : options_(options), reduced_(CopyOptions(nullptr)) {}

SeparableProblem::~SeparableProblem() = default;

std::string SeparableProblem::BlockName(const double* values, int index) const {
  std::string name;
  if (options_.block_name) name = options_.block_name(values);
  return name.empty() ? fmt::format("block {}", index) : "`" + name + "`";
}

bool SeparableProblem::CheckAllAffine(std::string* error) const {
  return std::all_of(costs_.begin(), costs_.end(), [&](const auto& cost) {
    const ComponentResiduals& residuals = cost->residuals();
    const auto name = [&](const ComponentResiduals::Parameter& at) {
      const auto& block = residuals.blocks()[at.block];
      return fmt::format(
          "{}[{}]", BlockName(block.values, block.index), at.component);
    };
    return CheckAffine(residuals, name, error);
  });
}

std::unique_ptr<SeparableProblem> SeparableProblem::Create(
    const Options& options,
    const std::vector<LinearBlock>& linear,
    ceres::Problem* problem,
    std::string* error) {
  CHECK(problem != nullptr);
  CHECK(error != nullptr);
  CHECK_GT(options.rank_threshold, 0.0);
  CHECK_LT(options.rank_threshold, 1.0);
  std::unique_ptr<SeparableProblem> result(new SeparableProblem(options));
  if (!Builder(*problem, result.get()).Build(linear, error) ||
      !result->CheckAllAffine(error)) {
    return nullptr;
  }
  // Names what fails at the start. Ceres' first evaluation is the same one.
  for (const auto& cost : result->costs_) {
    Eigen::VectorXd c;
    if (!cost->Solve(cost->residuals().Alpha().data(), &c, error)) {
      return nullptr;
    }
  }
  // Where linear and nonlinear parameters share a block, Ceres counts the linear
  // ones in the size of the block, of which a step is a share.
  for (const auto& cost : result->costs_) {
    if (!cost->residuals().has_loss()) result->ClearSharedBlocks(*cost);
  }
  return result;
}

void SeparableProblem::ClearSharedBlocks(const ReducedCost& cost) {
  const ComponentResiduals& residuals = cost.residuals();
  for (const ComponentResiduals::Parameter& at : residuals.linear()) {
    double* const values = residuals.blocks()[at.block].values;
    if (reduced_.HasParameterBlock(values)) values[at.component] = 0.0;
  }
}

bool SeparableProblem::SolveLinear(std::string* error) {
  rank_ = 0;
  for (const auto& cost : costs_) {
    Eigen::VectorXd c;
    if (!cost->Solve(cost->residuals().Alpha().data(), &c, error)) return false;
    cost->residuals().SetLinear(c);
    rank_ += cost->rank();
  }
  return CheckAllAffine(error);
}

}  // namespace invgrad
