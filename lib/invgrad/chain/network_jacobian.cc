#include "invgrad/chain/network_jacobian.h"

#include <utility>

#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NetworkJacobian::NetworkJacobian(DenseNetwork network,
                                 VectorXd weights,
                                 DenseNetwork::Activations activations,
                                 MatrixXd simulator_jacobians)
    : network_(std::move(network)),
      weights_(std::move(weights)),
      activations_(std::move(activations)),
      last_factor_(std::move(simulator_jacobians)) {
  const Index num_outputs = network_.num_outputs();
  CHECK_GT(activations_.num_columns(), 0);
  CHECK_EQ(weights_.size(), network_.num_weights());
  CHECK_EQ(activations_.outputs.rows(), num_outputs);
  CHECK_EQ(last_factor_.rows() % num_outputs, 0);
  num_calls_ = static_cast<int>(last_factor_.rows() / num_outputs);
  CHECK_GT(num_calls_, 0);
  CHECK_EQ(num_calls_ % activations_.num_channels, 0);
  CHECK_EQ(activations_.num_columns() % num_calls_, 0);
  const Index batch_size = activations_.num_columns() / num_calls_;
  CHECK_EQ(last_factor_.cols() % batch_size, 0);
  outputs_per_sample_ = static_cast<int>(last_factor_.cols() / batch_size);
  // The same numbers in the same order, one column per call.
  last_factor_.resize(num_outputs, num_calls_ * last_factor_.cols());
}

Eigen::Map<const MatrixXd> NetworkJacobian::SimulatorJacobians() const {
  return {last_factor_.data(), last_factor_.rows() * num_calls_, rows()};
}

void NetworkJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols());
  const Index r = outputs_per_sample_;
  MatrixXd dx;
  network_.Tangent(weights_, activations_, v, &dx);
  // |x| x B: the calls of a sample stacked in a column.
  dx.resize(dx.rows() * num_calls_, dx.cols() / num_calls_);
  Jv->resize(rows());
  for (Index s = 0; s < dx.cols(); ++s) {
    Jv->segment(s * r, r).noalias() =
        SimulatorJacobians().middleCols(s * r, r).transpose() * dx.col(s);
  }
}

void NetworkJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  CHECK_EQ(w.size(), rows());
  const Index r = outputs_per_sample_;
  const int num_columns = activations_.num_columns();
  MatrixXd x_bar(network_.num_outputs() * num_calls_, num_columns / num_calls_);
  for (Index s = 0; s < x_bar.cols(); ++s) {
    x_bar.col(s).noalias() =
        SimulatorJacobians().middleCols(s * r, r) * w.segment(s * r, r);
  }
  x_bar.resize(network_.num_outputs(), num_columns);  // a column a call
  network_.Backward(weights_, activations_, x_bar, Jtw);
}

const MatrixXd& NetworkJacobian::LayerFactor(int l) const {
  const int last = network_.num_layers() - 1;
  if (l == last) return last_factor_;
  std::call_once(hidden_factors_built_, [this, last] {
    hidden_factors_.resize(last);
    for (int k = last; k > 0; --k) {
      network_.BackwardThroughLayer(
          k,
          weights_,
          activations_,
          num_calls_,
          k == last ? last_factor_ : hidden_factors_[k],
          &hidden_factors_[k - 1]);
    }
  });
  return hidden_factors_[l];
}

LayerJacobian NetworkJacobian::Layer(int l) const {
  return LayerJacobian(&activations_.inputs[l], &LayerFactor(l), num_calls_);
}

std::vector<std::unique_ptr<const JacobianOperator>>
NetworkJacobian::ColumnBlocks() const {
  std::vector<std::unique_ptr<const JacobianOperator>> blocks;
  blocks.reserve(network_.num_layers());
  for (int l = 0; l < network_.num_layers(); ++l) {
    blocks.push_back(std::make_unique<LayerJacobian>(Layer(l)));
  }
  return blocks;
}

void NetworkJacobian::Gram(MatrixXd* JJt) const {
  std::vector<LayerJacobian> layers;
  layers.reserve(network_.num_layers());
  for (int l = 0; l < network_.num_layers(); ++l) layers.push_back(Layer(l));
  GramOfLayers(layers, ColumnStrips(rows(), nullptr), JJt);
}

void NetworkJacobian::ToDense(MatrixXd* J) const {
  J->resize(rows(), cols());
  for (int l = 0; l < network_.num_layers(); ++l) {
    Layer(l).WriteTo(J->middleCols(network_.offset(l), network_.layer_size(l)));
  }
}

std::string NetworkJacobian::RowName(int row) const {
  return SampleRowName(row, outputs_per_sample_);
}

}  // namespace invgrad
