#include "invgrad/ceres/residual_evaluation.h"

#include <cmath>
#include <numeric>

#include "fmt/core.h"
#include "invgrad/ceres/second_order_cost_function.h"

namespace invgrad {

std::string ResidualBlockMessage(int index, const std::string& what) {
  return fmt::format("residual block {}: {}", index, what);
}

bool LossCorrection::Compute(const ceres::LossFunction* loss_function,
                             double s) {
  if (loss_function == nullptr) {
    rho[0] = s;
    rho[1] = 1.0;
    rho[2] = 0.0;
    return true;
  }
  loss_function->Evaluate(s, rho);
  if (!(rho[1] >= 0.0)) return false;
  jacobian_scale = std::sqrt(rho[1]);
  residual_scale = jacobian_scale;
  // As in Ceres' corrector.cc, the second-order correction applies only if
  // rho'' > 0. Ceres' authors found that it slows down convergence for
  // outliers. J^T r~ is the exact gradient with and without it.
  if (s == 0.0 || rho[2] <= 0.0) return true;
  if (rho[1] == 0.0) return false;
  // The smaller root of alpha^2 / 2 - alpha - s rho'' / rho' = 0.
  const double alpha = 1.0 - std::sqrt(1.0 + 2.0 * s * rho[2] / rho[1]);
  residual_scale = jacobian_scale / (1.0 - alpha);
  alpha_by_s = alpha / s;
  return true;
}

bool ResidualEvaluation::Evaluate(const ResidualBlock& block,
                                  std::string* error) {
  r_.resize(block.size);
  const bool any_jacobian = plus_jacobians_ != nullptr && Reserve(block);
  double* const* values = structure_.values.data() + block.first_argument;
  if (!block.cost_function->Evaluate(
          values, r_.data(), any_jacobian ? ambient_.data() : nullptr)) {
    *error =
        ResidualBlockMessage(block.index, "the cost function returned false");
    return false;
  }
  if (!r_.allFinite()) {
    *error = ResidualBlockMessage(block.index, "a residual is not finite");
    return false;
  }
  if (any_jacobian) ToTangent(block);
  correction_ = LossCorrection();
  const ceres::LossFunction* loss_function =
      apply_loss_function_ ? block.loss_function : nullptr;
  if (!correction_.Compute(loss_function, r_.squaredNorm())) {
    *error =
        ResidualBlockMessage(block.index,
                             "the loss function needs rho' >= 0, and rho' > 0 "
                             "where rho'' > 0");
    return false;
  }
  if (!std::isfinite(correction_.rho[0])) {
    *error = ResidualBlockMessage(block.index, "the cost is not finite");
    return false;
  }
  return true;
}

void ResidualEvaluation::WriteResiduals(double* corrected) const {
  Eigen::Map<Eigen::VectorXd>(corrected, r_.size()) =
      correction_.residual_scale * r_;
}

void ResidualEvaluation::WriteJacobian(const ResidualBlock& block,
                                       double* values) const {
  for (int b = 0; b < block.num_arguments; ++b) {
    const Argument& argument = ArgumentOf(block, b);
    if (argument.block < 0) continue;
    const Eigen::Map<const RowMajorMatrix> J = Tangent(block, b);
    Eigen::Map<RowMajorMatrix, 0, Eigen::OuterStride<>> corrected(
        values + argument.entry,
        J.rows(),
        J.cols(),
        Eigen::OuterStride<>(block.row_length));
    if (correction_.jacobian_scale == 1.0) {
      corrected = J;
    } else {
      corrected = correction_.jacobian_scale * J;
    }
    if (correction_.alpha_by_s != 0.0) {
      const Eigen::RowVectorXd r_J = r_.transpose() * corrected;
      corrected -= correction_.alpha_by_s * r_ * r_J;
    }
  }
}

bool ResidualEvaluation::AddHessian(const ResidualBlock& block,
                                    Eigen::MatrixXd* hessian,
                                    std::string* error) const {
  const auto* cost_function =
      dynamic_cast<const SecondOrderCostFunction*>(block.cost_function);
  const std::vector<int>& sizes = cost_function->parameter_block_sizes();
  const int n = std::accumulate(sizes.begin(), sizes.end(), 0);
  Eigen::MatrixXd second(n, n);  // sum_i rho' r_i d2r_i/dx2, ambient
  const Eigen::VectorXd w = correction_.rho[1] * r_;
  if (!cost_function->WeightedHessian(
          structure_.values.data() + block.first_argument,
          w.data(),
          second.data())) {
    *error =
        ResidualBlockMessage(block.index, "WeightedHessian returned false");
    return false;
  }
  int row = 0;
  for (int a = 0; a < block.num_arguments; row += sizes[a++]) {
    const int block_a = ArgumentOf(block, a).block;
    if (block_a < 0) continue;
    int col = 0;
    for (int b = 0; b < block.num_arguments; col += sizes[b++]) {
      const int block_b = ArgumentOf(block, b).block;
      if (block_b < 0) continue;
      const Eigen::Map<const RowMajorMatrix> J_a = Tangent(block, a);
      const Eigen::Map<const RowMajorMatrix> J_b = Tangent(block, b);
      hessian->block(structure_.parameter_blocks[block_a].column,
                     structure_.parameter_blocks[block_b].column,
                     J_a.cols(),
                     J_b.cols()) +=
          PullBack(
              block_a, block_b, second.block(row, col, sizes[a], sizes[b])) +
          correction_.rho[1] * J_a.transpose() * J_b +
          2.0 * correction_.rho[2] * (J_a.transpose() * r_) *
              (J_b.transpose() * r_).transpose();
    }
  }
  return true;
}

// dr/d(tangent of argument b), uncorrected.
Eigen::Map<const ResidualEvaluation::RowMajorMatrix>
ResidualEvaluation::Tangent(const ResidualBlock& block, int b) const {
  return {tangent_[b],
          block.size,
          structure_.parameter_blocks[ArgumentOf(block, b).block].tangent_size};
}

// Reserves memory for the Jacobians with respect to the arguments that are not
// constant. Returns false if all are constant.
bool ResidualEvaluation::Reserve(const ResidualBlock& block) {
  std::size_t size = 0;
  for (int b = 0; b < block.num_arguments; ++b) {
    const int index = ArgumentOf(block, b).block;
    if (index < 0) continue;
    const ParameterBlock& parameters = structure_.parameter_blocks[index];
    size += std::size_t{1} * block.size *
            (parameters.ambient_size + parameters.tangent_size);
  }
  if (memory_.size() < size) memory_.resize(size);
  ambient_.assign(block.num_arguments, nullptr);
  tangent_.assign(block.num_arguments, nullptr);
  double* memory = memory_.data();
  for (int b = 0; b < block.num_arguments; ++b) {
    const int index = ArgumentOf(block, b).block;
    if (index < 0) continue;
    const ParameterBlock& parameters = structure_.parameter_blocks[index];
    ambient_[b] = memory;
    tangent_[b] = memory;
    memory += std::ptrdiff_t{block.size} * parameters.ambient_size;
    if ((*plus_jacobians_)[index].size() == 0) continue;
    tangent_[b] = memory;
    memory += std::ptrdiff_t{block.size} * parameters.tangent_size;
  }
  return size > 0;
}

void ResidualEvaluation::ToTangent(const ResidualBlock& block) {
  for (int b = 0; b < block.num_arguments; ++b) {
    if (tangent_[b] == ambient_[b]) continue;
    const RowMajorMatrix& P = (*plus_jacobians_)[ArgumentOf(block, b).block];
    Eigen::Map<RowMajorMatrix>(tangent_[b], block.size, P.cols()).noalias() =
        Eigen::Map<const RowMajorMatrix>(ambient_[b], block.size, P.rows())
            .lazyProduct(P);
  }
}

// P_a^T H P_b.
Eigen::MatrixXd ResidualEvaluation::PullBack(int a,
                                             int b,
                                             const Eigen::MatrixXd& H) const {
  const RowMajorMatrix& P_a = (*plus_jacobians_)[a];
  const RowMajorMatrix& P_b = (*plus_jacobians_)[b];
  Eigen::MatrixXd result = P_a.size() > 0 ? P_a.transpose() * H : H;
  if (P_b.size() > 0) result = result * P_b;
  return result;
}

}  // namespace invgrad
