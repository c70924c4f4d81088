#include "invgrad/ceres/residual_evaluation.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "fmt/core.h"
#include "invgrad/second_order_cost_function.h"

namespace invgrad {

std::string ResidualBlockMessage(int index, const std::string& what) {
  return fmt::format("residual block {}: {}", index, what);
}

bool ResidualEvaluation::Evaluate(const ResidualBlock& block,
                                  std::string* error) {
  block_ = &block;
  r_.resize(block.size);
  bool any_jacobian = false;
  if (plus_jacobians_ != nullptr) {
    const std::size_t num_arguments = block.num_arguments;
    ambient_.resize(std::max(ambient_.size(), num_arguments));
    tangent_.resize(ambient_.size());
    jacobians_.assign(num_arguments, nullptr);
    for (int b = 0; b < block.num_arguments; ++b) {
      const int index = ArgumentOf(b).block;
      if (index < 0) continue;
      ambient_[b].resize(block.size,
                         structure_.parameter_blocks[index].ambient_size);
      jacobians_[b] = ambient_[b].data();
      any_jacobian = true;
    }
  }
  if (!block.cost_function->Evaluate(
          structure_.values.data() + block.first_argument,
          r_.data(),
          any_jacobian ? jacobians_.data() : nullptr)) {
    *error =
        ResidualBlockMessage(block.index, "the cost function returned false");
    return false;
  }
  if (!r_.allFinite()) {
    *error = ResidualBlockMessage(block.index, "a residual is not finite");
    return false;
  }
  for (int b = 0; any_jacobian && b < block.num_arguments; ++b) {
    if (jacobians_[b] == nullptr || PlusJacobian(b).size() == 0) continue;
    tangent_[b].resize(block.size, PlusJacobian(b).cols());
    tangent_[b].noalias() = ambient_[b].lazyProduct(PlusJacobian(b));
  }
  return CorrectLoss(error);
}

bool ResidualEvaluation::CorrectLoss(std::string* error) {
  const double s = r_.squaredNorm();
  rho_[0] = s;
  rho_[1] = 1.0;
  rho_[2] = 0.0;
  alpha_by_s_ = 0.0;
  if (apply_loss_function_ && block_->loss_function != nullptr) {
    block_->loss_function->Evaluate(s, rho_);
  }
  // As in Ceres' corrector.cc, the second-order correction applies only if
  // rho'' > 0. Ceres' authors found that it slows down convergence for
  // outliers. J^T r~ is the exact gradient with and without it.
  const bool is_second_order = s != 0.0 && rho_[2] > 0.0;
  if (!(rho_[1] >= 0.0) || (is_second_order && rho_[1] == 0.0)) {
    *error = ResidualBlockMessage(
        block_->index,
        "the loss function needs rho' >= 0, and rho' > 0 where rho'' > 0");
    return false;
  }
  if (!std::isfinite(rho_[0])) {
    *error = ResidualBlockMessage(block_->index, "the cost is not finite");
    return false;
  }
  jacobian_scale_ = std::sqrt(rho_[1]);
  residual_scale_ = jacobian_scale_;
  if (is_second_order) {
    // The smaller root of alpha^2 / 2 - alpha - s rho'' / rho' = 0.
    const double alpha = 1.0 - std::sqrt(1.0 + 2.0 * s * rho_[2] / rho_[1]);
    residual_scale_ = jacobian_scale_ / (1.0 - alpha);
    alpha_by_s_ = alpha / s;
  }
  return true;
}

void ResidualEvaluation::WriteResiduals(double scale, double* scaled) const {
  Eigen::Map<Eigen::VectorXd>(scaled, r_.size()) = scale * r_;
}

bool ResidualEvaluation::WriteJacobian(double* values,
                                       std::string* error) const {
  const auto corrected_of = [&](int b) {
    return Eigen::Map<RowMajorMatrix, 0, Eigen::OuterStride<>>(
        values + ArgumentOf(b).entry,
        block_->size,
        Tangent(b).cols(),
        Eigen::OuterStride<>(block_->row_length));
  };
  for (int b = 0; b < block_->num_arguments; ++b) {
    if (ArgumentOf(b).block < 0) continue;
    auto corrected = corrected_of(b);
    if (jacobian_scale_ == 1.0) {
      corrected = Tangent(b);
    } else {
      corrected = jacobian_scale_ * Tangent(b);
    }
    if (alpha_by_s_ != 0.0) {
      const Eigen::RowVectorXd r_J = r_.transpose() * corrected;
      corrected -= alpha_by_s_ * r_ * r_J;
    }
  }
  const Eigen::Index num_values =
      Eigen::Index{block_->size} * block_->row_length;
  if (Eigen::Map<const Eigen::VectorXd>(values, num_values).allFinite()) {
    return true;
  }
  int b = 0;
  while (ArgumentOf(b).block < 0 || corrected_of(b).allFinite()) ++b;
  *error = ResidualBlockMessage(
      block_->index,
      fmt::format("its Jacobian by parameter block {} is not finite", b));
  return false;
}

bool ResidualEvaluation::AddHessian(Eigen::MatrixXd* hessian,
                                    std::string* error) const {
  const auto* cost_function =
      dynamic_cast<const SecondOrderCostFunction*>(block_->cost_function);
  const std::vector<int>& sizes = cost_function->parameter_block_sizes();
  const int n = std::accumulate(sizes.begin(), sizes.end(), 0);
  Eigen::MatrixXd second(n, n);  // sum_i rho' r_i d2r_i/dx2, ambient
  const Eigen::VectorXd w = rho_[1] * r_;
  if (!cost_function->WeightedHessian(
          structure_.values.data() + block_->first_argument,
          w.data(),
          second.data())) {
    *error =
        ResidualBlockMessage(block_->index, "WeightedHessian returned false");
    return false;
  }
  int row = 0;
  for (int a = 0; a < block_->num_arguments; row += sizes[a++]) {
    if (ArgumentOf(a).block < 0) continue;
    int col = 0;
    for (int b = 0; b < block_->num_arguments; col += sizes[b++]) {
      if (ArgumentOf(b).block < 0) continue;
      const RowMajorMatrix& J_a = Tangent(a);
      const RowMajorMatrix& J_b = Tangent(b);
      // P_a^T H P_b
      Eigen::MatrixXd H = second.block(row, col, sizes[a], sizes[b]);
      if (PlusJacobian(a).size() > 0) {
        H = (PlusJacobian(a).transpose() * H).eval();
      }
      if (PlusJacobian(b).size() > 0) H = (H * PlusJacobian(b)).eval();
      hessian->block(structure_.parameter_blocks[ArgumentOf(a).block].column,
                     structure_.parameter_blocks[ArgumentOf(b).block].column,
                     J_a.cols(),
                     J_b.cols()) += H + rho_[1] * J_a.transpose() * J_b +
                                    2.0 * rho_[2] * (J_a.transpose() * r_) *
                                        (J_b.transpose() * r_).transpose();
    }
  }
  return true;
}

}  // namespace invgrad
