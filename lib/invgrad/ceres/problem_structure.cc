#include "invgrad/ceres/problem_structure.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "invgrad/internal/logging.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

// Reads the structure in one pass over the residual blocks, because each call
// of a ceres::Problem is a look-up.
class Reader {
 public:
  explicit Reader(const ceres::Problem& problem) : problem_(problem) {
    block_of_.reserve(problem.NumParameterBlocks());
  }

  ProblemStructure Read(const std::vector<ceres::ResidualBlockId>& batch) {
    std::vector<ceres::ResidualBlockId> ids;
    problem_.GetResidualBlocks(&ids);
    const std::size_t size = batch.empty() ? ids.size() : batch.size();
    structure_.residual_blocks.reserve(size);
    structure_.arguments.reserve(2 * size);
    structure_.values.reserve(2 * size);
    std::unordered_map<ceres::ResidualBlockId, int> index_of;  // of a batch
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (batch.empty()) {
        AddResidualBlock(ids[i], static_cast<int>(i));
        continue;
      }
      problem_.GetParameterBlocksForResidualBlock(ids[i], &values_);
      for (double* values : values_) AddParameterBlock(values);
      index_of[ids[i]] = static_cast<int>(i);
    }
    problem_.GetParameterBlocks(&values_);
    for (double* values : values_) AddParameterBlock(values);
    for (const ceres::ResidualBlockId id : batch) {
      const auto it = index_of.find(id);
      CHECK(it != index_of.end())
          << "A residual block of the mini-batch is not part of the problem.";
      AddResidualBlock(id, it->second);
    }
    return std::move(structure_);
  }

 private:
  // Returns its index in parameter_blocks, -1 if it is constant.
  int AddParameterBlock(double* values) {
    const auto [it, is_new] = block_of_.try_emplace(values, -1);
    if (!is_new || problem_.IsParameterBlockConstant(values)) {
      return it->second;
    }
    it->second = static_cast<int>(structure_.parameter_blocks.size());
    const ProblemStructure::ParameterBlock block = {
        values,
        problem_.ParameterBlockSize(values),
        problem_.ParameterBlockTangentSize(values),
        structure_.num_parameters,
        structure_.num_ambient,
        problem_.GetManifold(values)};
    structure_.parameter_blocks.push_back(block);
    structure_.tangent_sizes.push_back(block.tangent_size);
    structure_.num_parameters += block.tangent_size;
    structure_.num_ambient += block.ambient_size;
    return it->second;
  }

  void AddResidualBlock(ceres::ResidualBlockId id, int index) {
    std::vector<ProblemStructure::Argument>& arguments = structure_.arguments;
    ProblemStructure::ResidualBlock block;
    block.cost_function = problem_.GetCostFunctionForResidualBlock(id);
    block.loss_function = problem_.GetLossFunctionForResidualBlock(id);
    block.index = index;
    block.row = structure_.num_residuals;
    block.size = block.cost_function->num_residuals();
    block.first_argument = static_cast<int>(arguments.size());
    problem_.GetParameterBlocksForResidualBlock(id, &values_);
    block.num_arguments = static_cast<int>(values_.size());
    block.row_length = 0;
    by_column_.clear();
    for (double* values : values_) {
      const int b = AddParameterBlock(values);
      if (b >= 0) by_column_.emplace_back(b, arguments.size());
      structure_.values.push_back(values);
      arguments.push_back({b, 0});
    }
    std::sort(by_column_.begin(), by_column_.end());
    for (const auto& [b, argument] : by_column_) {
      arguments[argument].entry = block.row_length;
      block.row_length += structure_.parameter_blocks[b].tangent_size;
    }
    structure_.num_residuals += block.size;
    if (block.row_length > 0) structure_.num_variable_residuals += block.size;
    structure_.num_entries += std::int64_t{block.size} * block.row_length;
    structure_.residual_blocks.push_back(block);
  }

  const ceres::Problem& problem_;
  ProblemStructure structure_;
  // Indices in parameter_blocks; -1: constant.
  std::unordered_map<const double*, int> block_of_;
  std::vector<double*> values_;
  std::vector<std::pair<int, std::size_t>> by_column_;
};

}  // namespace

ProblemStructure ReadStructure(
    const ceres::Problem& problem,
    const std::vector<ceres::ResidualBlockId>& batch) {
  return Reader(problem).Read(batch);
}

Eigen::VectorXd ProblemStructure::State() const {
  Eigen::VectorXd state(num_ambient);
  for (const ParameterBlock& block : parameter_blocks) {
    std::copy_n(block.values, block.ambient_size, state.data() + block.offset);
  }
  return state;
}

void ProblemStructure::SetState(const Eigen::VectorXd& state) const {
  CHECK_EQ(state.size(), num_ambient);
  for (const ParameterBlock& block : parameter_blocks) {
    std::copy_n(state.data() + block.offset, block.ambient_size, block.values);
  }
}

std::vector<int> ProblemStructure::Plus(const Eigen::VectorXd& step,
                                        Eigen::VectorXd* state) const {
  CHECK_EQ(step.size(), num_parameters);
  std::vector<int> failing;
  *state = State();
  for (std::size_t b = 0; b < parameter_blocks.size(); ++b) {
    const ParameterBlock& block = parameter_blocks[b];
    if (block.manifold == nullptr) {
      state->segment(block.offset, block.ambient_size) +=
          step.segment(block.column, block.tangent_size);
    } else if (!block.manifold->Plus(block.values,
                                     step.data() + block.column,
                                     state->data() + block.offset)) {
      failing.push_back(static_cast<int>(b));
    }
  }
  return failing;
}

std::shared_ptr<SparseJacobian> ProblemStructure::NewJacobian() const {
  CHECK_LE(num_entries, std::numeric_limits<int>::max())
      << "J has more entries than a sparse matrix can count.";
  SparseJacobian::Matrix J(num_residuals, num_parameters);
  J.resizeNonZeros(static_cast<int>(num_entries));
  int* row_start = J.outerIndexPtr();
  int* column = J.innerIndexPtr();
  *row_start = 0;
  for (const ResidualBlock& block : residual_blocks) {
    const int* const first_row = column;
    for (int b = 0; b < block.num_arguments; ++b) {
      const Argument& argument = arguments[block.first_argument + b];
      if (argument.block < 0) continue;
      const ParameterBlock& parameters = parameter_blocks[argument.block];
      std::iota(column + argument.entry,
                column + argument.entry + parameters.tangent_size,
                parameters.column);
    }
    column += block.row_length;
    for (int i = 0; i < block.size; ++i) {
      if (i > 0) column = std::copy_n(first_row, block.row_length, column);
      row_start[1] = row_start[0] + block.row_length;
      ++row_start;
    }
  }
  return std::make_shared<SparseJacobian>(std::move(J), tangent_sizes);
}

}  // namespace invgrad
