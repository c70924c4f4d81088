#include "invgrad/separable/component_residuals.h"

#include <algorithm>
#include <cstddef>

#include "invgrad/ceres/residual_evaluation.h"

namespace invgrad {

int ComponentResiduals::AddBlock(double* values,
                                 int size,
                                 int index,
                                 const std::vector<bool>& is_linear) {
  const int number = static_cast<int>(blocks_.size());
  Block block;
  block.values = values;
  block.size = size;
  block.index = index;
  const auto num_linear = std::count(is_linear.begin(), is_linear.end(), true);
  if (num_linear > 0) {
    block.linear.assign(size, -1);
    for (int i = 0; i < size; ++i) {
      if (!is_linear[i]) continue;
      block.linear[i] = static_cast<int>(linear_.size());
      linear_.push_back({number, i});
    }
  }
  if (index >= 0 && num_linear < size) {
    block.argument = static_cast<int>(arguments_.size());
    block.column = num_columns_;
    arguments_.push_back(number);
    num_columns_ += size;
  }
  blocks_.push_back(block);
  return number;
}

void ComponentResiduals::AddResidualBlock(
    const ceres::CostFunction* cost_function,
    const ceres::LossFunction* loss_function,
    int index,
    const std::vector<int>& blocks) {
  const int size = cost_function->num_residuals();
  residual_blocks_.push_back(
      {cost_function, loss_function, index, num_residuals_, size, blocks});
  num_residuals_ += size;
  has_loss_ = has_loss_ || loss_function != nullptr;
}

bool ComponentResiduals::Evaluate(const double* const* alpha,
                                  const Eigen::VectorXd& c,
                                  Eigen::VectorXd* r,
                                  Eigen::MatrixXd* A,
                                  Eigen::MatrixXd* Phi,
                                  std::string* error) const {
  with_c_.resize(blocks_.size());
  values_.resize(blocks_.size());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Block& block = blocks_[b];
    values_[b] = block.argument < 0 ? block.values : alpha[block.argument];
    if (block.linear.empty()) continue;
    with_c_[b] = Eigen::Map<const Eigen::VectorXd>(values_[b], block.size);
    for (int i = 0; i < block.size; ++i) {
      if (block.linear[i] >= 0) with_c_[b][i] = c[block.linear[i]];
    }
    values_[b] = with_c_[b].data();
  }
  r->resize(num_residuals_);
  if (A != nullptr) A->setZero(num_residuals_, num_columns_);
  if (Phi != nullptr) Phi->setZero(num_residuals_, num_linear());
  return std::all_of(residual_blocks_.begin(),
                     residual_blocks_.end(),
                     [&](const ResidualBlock& block) {
                       return EvaluateBlock(block, r, A, Phi, error);
                     });
}

bool ComponentResiduals::EvaluateBlock(const ResidualBlock& residual_block,
                                       Eigen::VectorXd* r,
                                       Eigen::MatrixXd* A,
                                       Eigen::MatrixXd* Phi,
                                       std::string* error) const {
  const std::size_t num_arguments = residual_block.blocks.size();
  const int row = residual_block.row;
  const int size = residual_block.size;
  parameters_.resize(num_arguments);
  J_.resize(std::max(J_.size(), num_arguments));
  jacobians_.assign(num_arguments, nullptr);
  for (std::size_t a = 0; a < num_arguments; ++a) {
    const Block& block = blocks_[residual_block.blocks[a]];
    parameters_[a] = values_[residual_block.blocks[a]];
    if ((A != nullptr && block.argument >= 0) ||
        (Phi != nullptr && !block.linear.empty())) {
      J_[a].resize(size, block.size);
      jacobians_[a] = J_[a].data();
    }
  }
  const bool needs_jacobian = A != nullptr || Phi != nullptr;
  if (!residual_block.cost_function->Evaluate(
          parameters_.data(),
          r->data() + row,
          needs_jacobian ? jacobians_.data() : nullptr)) {
    *error = ResidualBlockMessage(residual_block.index,
                                  "the cost function returned false");
    return false;
  }
  bool is_finite = r->segment(row, size).allFinite();
  for (std::size_t a = 0; a < num_arguments; ++a) {
    if (jacobians_[a] == nullptr) continue;
    const Block& block = blocks_[residual_block.blocks[a]];
    is_finite = is_finite && J_[a].allFinite();
    for (int i = 0; i < block.size; ++i) {
      const int column = block.linear.empty() ? -1 : block.linear[i];
      if (column < 0 && A != nullptr && block.argument >= 0) {
        A->col(block.column + i).segment(row, size) += J_[a].col(i);
      } else if (column >= 0 && Phi != nullptr) {
        Phi->col(column).segment(row, size) += J_[a].col(i);
      }
    }
  }
  if (!is_finite) {
    *error = ResidualBlockMessage(residual_block.index,
                                  "a residual or a derivative is not finite");
  }
  return is_finite;
}

std::vector<const double*> ComponentResiduals::Alpha() const {
  std::vector<const double*> alpha;
  for (const int b : arguments_) alpha.push_back(blocks_[b].values);
  return alpha;
}

Eigen::VectorXd ComponentResiduals::Linear() const {
  Eigen::VectorXd c(num_linear());
  for (int j = 0; j < num_linear(); ++j) {
    c[j] = blocks_[linear_[j].block].values[linear_[j].component];
  }
  return c;
}

void ComponentResiduals::SetLinear(const Eigen::VectorXd& c) const {
  for (int j = 0; j < num_linear(); ++j) {
    blocks_[linear_[j].block].values[linear_[j].component] = c[j];
  }
}

}  // namespace invgrad
