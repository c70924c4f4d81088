#include "invgrad/distributed/distributed_jacobian.h"

#include <algorithm>
#include <utility>

#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

DistributedJacobian::DistributedJacobian(
    std::shared_ptr<const JacobianOperator> own,
    std::shared_ptr<const Communicator> communicator,
    int num_samples)
    : own_(std::move(own)),
      communicator_(std::move(communicator)),
      num_samples_(num_samples) {
  const int own_samples = communicator_->OwnShare(num_samples).count;
  CHECK_GT(own_samples, 0);
  CHECK_EQ(own_->rows() % own_samples, 0);
  rows_per_sample_ = own_->rows() / own_samples;
}

VectorXd DistributedJacobian::GatherRows(const VectorXd& own) const {
  return communicator_
      ->GatherColumns(own.transpose(), num_samples_, rows_per_sample_)
      .transpose();
}

VectorXd DistributedJacobian::OwnRows(const VectorXd& w) const {
  CHECK_EQ(w.size(), rows());
  const Share share = communicator_->OwnShare(num_samples_);
  return w.segment(Index{rows_per_sample_} * share.first,
                   Index{rows_per_sample_} * share.count);
}

void DistributedJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  VectorXd own;
  own_->Times(v, &own);
  *Jv = GatherRows(own);
}

void DistributedJacobian::TransposeTimes(const VectorXd& w,
                                         VectorXd* Jtw) const {
  own_->TransposeTimes(OwnRows(w), Jtw);
  communicator_->Sum(Jtw->data(), Jtw->size());
}

void DistributedJacobian::ToDense(MatrixXd* J) const {
  MatrixXd own;
  own_->ToDense(&own);
  *J = communicator_
           ->GatherColumns(own.transpose(), num_samples_, rows_per_sample_)
           .transpose();
}

void DistributedJacobian::ParameterGram(MatrixXd* JtJ) const {
  own_->ParameterGram(JtJ);
  communicator_->Sum(JtJ->data(), JtJ->size());
}

void DistributedJacobian::Gram(MatrixXd* JJt) const {
  const ColumnStrips strips(rows(), communicator_.get());
  MatrixXd own;
  GramStrips(strips, &own);
  JJt->resize(rows(), rows());
  constexpr Index kWidth = ColumnStrips::kWidth;
  for (Index first = 0; first < rows(); first += kWidth) {
    const Index count = std::min(kWidth, rows() - first);
    if (strips.Owns(first)) {
      JJt->middleCols(first, count) =
          own.middleCols(strips.Local(first), count);
    }
    communicator_->Broadcast(
        strips.Owner(first), JJt->col(first).data(), rows() * count);
  }
}

void DistributedJacobian::GramStrips(const ColumnStrips& strips,
                                     MatrixXd* JJt) const {
  if (!Factors().empty()) {
    GramOfLayers(Layers(), strips, JJt);
    return;
  }
  MatrixXd J;
  ToDense(&J);
  JJt->resize(rows(), strips.num_local());
  strips.ForOwn([&](Index first, Index count) {
    JJt->middleCols(strips.Local(first), count).noalias() =
        J * J.middleRows(first, count).transpose();
  });
}

void DistributedJacobian::ParameterGramStrips(const ColumnStrips& strips,
                                              MatrixXd* JtJ) const {
  MatrixXd own;
  own_->ParameterGram(&own);
  JtJ->resize(cols(), strips.num_local());
  constexpr Index kWidth = ColumnStrips::kWidth;
  const int num_ranks = strips.num_ranks();
  // Of num_ranks strips side by side, each rank gets one.
  for (Index first = 0; first < cols(); first += num_ranks * kWidth) {
    std::vector<std::ptrdiff_t> sizes(num_ranks);
    for (int r = 0; r < num_ranks; ++r) {
      sizes[r] =
          cols() * std::clamp<Index>(cols() - first - r * kWidth, 0, kWidth);
    }
    communicator_->SumParts(own.col(first).data(),
                            sizes,
                            JtJ->data() + cols() * strips.Local(first));
  }
}

std::string DistributedJacobian::RowName(int row) const {
  return SampleRowName(row, rows_per_sample_);
}

const std::vector<DistributedJacobian::LayerFactors>&
DistributedJacobian::Factors() const {
  std::call_once(factors_gathered_, [this] {
    for (const auto& block : ColumnBlocksOf(*own_)) {
      const auto* layer = dynamic_cast<const LayerJacobian*>(block.get());
      if (layer == nullptr) {
        factors_.clear();
        return;
      }
      const int num_calls = layer->num_calls();
      factors_.push_back(
          {communicator_->GatherColumns(
               layer->inputs(), num_samples_, num_calls),
           communicator_->GatherColumns(
               layer->deltas(), num_samples_, num_calls * rows_per_sample_),
           num_calls});
    }
  });
  return factors_;
}

std::vector<LayerJacobian> DistributedJacobian::Layers() const {
  std::vector<LayerJacobian> layers;
  for (const LayerFactors& factors : Factors()) {
    layers.emplace_back(&factors.inputs, &factors.deltas, factors.num_calls);
  }
  return layers;
}

std::vector<std::unique_ptr<const JacobianOperator>>
DistributedJacobian::ColumnBlocks() const {
  std::vector<std::unique_ptr<const JacobianOperator>> blocks;
  for (const LayerJacobian& layer : Layers()) {
    blocks.push_back(std::make_unique<LayerJacobian>(layer));
  }
  return blocks;
}

void DistributedJacobian::FactorsAlong(const VectorXd& w,
                                       SampledFactors* factors) const {
  LayersOf(*own_)->FactorsAlong(OwnRows(w), factors);
  // A is a mean over positions, of which each sample has as many.
  const double share =
      static_cast<double>(communicator_->OwnShare(num_samples_).count) /
      num_samples_;
  for (SampledFactors::Layer& layer : factors->layers) {
    layer.A *= share;
    communicator_->Sum(layer.A.data(), layer.A.size());
    communicator_->Sum(layer.D.data(), layer.D.size());
  }
  communicator_->Sum(factors->others.data(), factors->others.size());
}

}  // namespace invgrad
