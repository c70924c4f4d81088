#include "invgrad/output_layer/reduced_jacobian.h"

#include <algorithm>
#include <utility>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ReducedJacobian::ReducedJacobian(std::shared_ptr<const JacobianOperator> J,
                                 std::vector<int> others,
                                 MatrixXd Q)
    : J_(std::move(J)),
      others_(std::move(others)),
      Q_(std::move(Q)),
      number_of_(J_->cols(), -1) {
  CHECK(!others_.empty());
  CHECK(std::is_sorted(others_.begin(), others_.end()));
  CHECK_LT(others_.back(), J_->cols());
  if (projects()) CHECK_EQ(Q_.rows(), J_->rows());
  for (size_t i = 0; i < others_.size(); ++i) {
    number_of_[others_[i]] = static_cast<int>(i);
  }
}

void ReducedJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols());
  VectorXd all = VectorXd::Zero(J_->cols());
  all(others_) = v;
  J_->Times(all, Jv);
  if (projects()) *Jv -= Q_ * (Q_.transpose() * *Jv);
}

void ReducedJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  VectorXd left = w;
  if (projects()) left -= Q_ * (Q_.transpose() * w);
  VectorXd all;
  J_->TransposeTimes(left, &all);
  *Jtw = all(others_);
}

void ReducedJacobian::Gram(MatrixXd* JJt) const {
  const auto blocks = ColumnBlocks();
  if (blocks.empty() || projects()) {
    JacobianOperator::Gram(JJt);
    return;
  }
  blocks[0]->Gram(JJt);
  MatrixXd of_block;
  for (size_t l = 1; l < blocks.size(); ++l) {
    blocks[l]->Gram(&of_block);
    JJt->triangularView<Eigen::Lower>() += of_block;
  }
}

void ReducedJacobian::ToDense(MatrixXd* J) const {
  MatrixXd all;
  J_->ToDense(&all);
  *J = all(Eigen::all, others_);
  if (!projects()) return;
  MatrixXd inside(Q_.cols(), J->cols());
  Gemm(Op::kTranspose, Op::kNone, 1.0, Q_, *J, 0.0, inside);
  Gemm(Op::kNone, Op::kNone, -1.0, Q_, inside, 1.0, *J);
}

std::vector<std::unique_ptr<const JacobianOperator>>
ReducedJacobian::ColumnBlocks() const {
  auto blocks = ColumnBlocksOf(*J_);
  if (!blocks.empty()) {
    CHECK_EQ(J_->cols() - blocks.back()->cols(), cols());
    blocks.pop_back();
  }
  return blocks;
}

std::vector<int> ReducedJacobian::LayersOfOthers() const {
  std::vector<int> layers;
  const std::vector<LayerColumns> all = FactorLayersOf(*J_);
  for (size_t l = 0; l < all.size(); ++l) {
    if (number_of_[all[l](0, 0)] >= 0) layers.push_back(static_cast<int>(l));
  }
  return layers;
}

std::vector<LayerColumns> ReducedJacobian::FactorLayers() const {
  const std::vector<LayerColumns> all = FactorLayersOf(*J_);
  std::vector<LayerColumns> layers;
  for (const int l : LayersOfOthers()) {
    layers.push_back(
        all[l].unaryExpr([this](int column) { return number_of_[column]; }));
  }
  return layers;
}

void ReducedJacobian::FactorsAlong(const VectorXd& w,
                                   SampledFactors* factors) const {
  SampledFactors all;
  LayersOf(*J_)->FactorsAlong(w, &all);
  factors->layers.clear();
  for (const int l : LayersOfOthers()) {
    factors->layers.push_back(std::move(all.layers[l]));
  }
  factors->others = all.others(others_);
}

}  // namespace invgrad
