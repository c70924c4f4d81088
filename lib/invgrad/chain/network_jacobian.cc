#include "invgrad/chain/network_jacobian.h"

#include <utility>

#include "glog/logging.h"
#include "invgrad/linalg/blas.h"

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
      simulator_jacobians_(std::move(simulator_jacobians)) {
  const int batch_size = activations_.batch_size();
  CHECK_GT(batch_size, 0);
  CHECK_EQ(weights_.size(), network_.num_weights());
  CHECK_EQ(activations_.outputs.rows(), network_.num_outputs());
  CHECK_EQ(simulator_jacobians_.rows(), network_.num_outputs());
  CHECK_EQ(simulator_jacobians_.cols() % batch_size, 0);
  outputs_per_sample_ =
      static_cast<int>(simulator_jacobians_.cols() / batch_size);
}

void NetworkJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols());
  const Index r = outputs_per_sample_;
  MatrixXd dx;  // |x| x B
  network_.Tangent(weights_, activations_, v, &dx);
  Jv->resize(rows());
  for (int s = 0; s < activations_.batch_size(); ++s) {
    Jv->segment(s * r, r).noalias() =
        simulator_jacobians_.middleCols(s * r, r).transpose() * dx.col(s);
  }
}

void NetworkJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  CHECK_EQ(w.size(), rows());
  const Index r = outputs_per_sample_;
  MatrixXd x_bar(network_.num_outputs(), activations_.batch_size());
  for (int s = 0; s < activations_.batch_size(); ++s) {
    x_bar.col(s).noalias() =
        simulator_jacobians_.middleCols(s * r, r) * w.segment(s * r, r);
  }
  network_.Backward(weights_, activations_, x_bar, Jtw);
}

const MatrixXd& NetworkJacobian::LayerFactor(int l) const {
  const int last = network_.num_layers() - 1;
  if (l == last) return simulator_jacobians_;
  std::call_once(hidden_factors_built_, [this, last] {
    const std::vector<int>& widths = network_.widths();
    hidden_factors_.resize(last);
    const MatrixXd* above = &simulator_jacobians_;
    for (int k = last; k > 0; --k) {
      MatrixXd& delta = hidden_factors_[k - 1];
      delta.resize(widths[k], rows());
      Gemm(Op::kNone,
           Op::kNone,
           1.0,
           Eigen::Map<const MatrixXd>(weights_.data() + network_.offset(k),
                                      widths[k] + 1,
                                      widths[k + 1])
               .topRows(widths[k]),
           *above,
           0.0,
           delta);
      const MatrixXd& slopes = activations_.slopes[k - 1];
      for (Index row = 0; row < delta.cols(); ++row) {
        delta.col(row).array() *= slopes.col(row / outputs_per_sample_).array();
      }
      above = &delta;
    }
  });
  return hidden_factors_[l];
}

LayerJacobian NetworkJacobian::Layer(int l) const {
  return LayerJacobian(&activations_.inputs[l], &LayerFactor(l));
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
  GramOfLayers(layers, JJt);
}

void NetworkJacobian::ToDense(MatrixXd* J) const {
  J->resize(rows(), cols());
  for (int l = 0; l < network_.num_layers(); ++l) {
    Layer(l).WriteTo(J->middleCols(network_.offset(l), network_.layer_size(l)));
  }
}

std::string NetworkJacobian::RowName(int row) const {
  return JacobianOperator::RowName(row) + " (sample " +
         std::to_string(row / outputs_per_sample_) + ", output " +
         std::to_string(row % outputs_per_sample_) + ")";
}

}  // namespace invgrad
