#include "invgrad/chain/network_jacobian.h"

#include <algorithm>
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

void NetworkJacobian::Gram(MatrixXd* JJt) const {
  const int L = network_.num_layers();
  const Index r = outputs_per_sample_;
  const Index batch_size = activations_.batch_size();
  JJt->resize(rows(), rows());

  std::vector<MatrixXd> input_grams(L);  // B x B: a_s . a_t, lower triangle
  for (int l = 0; l < L; ++l) {
    input_grams[l].resize(batch_size, batch_size);
    Syrk(Op::kTranspose, 1.0, activations_.inputs[l], 0.0, input_grams[l]);
    input_grams[l].triangularView<Eigen::StrictlyUpper>() =
        input_grams[l].transpose();
  }

  // Tiles of whole samples, small enough that a layer's products stay in the
  // cache until they are scaled and added, large enough for Gemm to be fast.
  // Measured: 64 is best for r = 4, 128 by a tenth for r = 28 and 64.
  const Index samples_per_tile = std::max<Index>(1, (r < 16 ? 64 : 128) / r);
  const Index tile = samples_per_tile * r;
  MatrixXd delta_gram(tile, tile);
  VectorXd scale(tile);  // a_s . a_t for the rows (s, j) of the tile
  for (Index t0 = 0; t0 < batch_size; t0 += samples_per_tile) {
    const Index num_t = std::min(samples_per_tile, batch_size - t0);
    for (Index s0 = t0; s0 < batch_size; s0 += samples_per_tile) {
      const Index num_s = std::min(samples_per_tile, batch_size - s0);
      const Index height = num_s * r;
      const Index width = num_t * r;
      for (int l = 0; l < L; ++l) {
        const MatrixXd& delta = LayerFactor(l);
        Gemm(Op::kTranspose,
             Op::kNone,
             1.0,
             delta.middleCols(s0 * r, height),
             delta.middleCols(t0 * r, width),
             0.0,
             delta_gram.topLeftCorner(height, width));
        for (Index t = 0; t < num_t; ++t) {
          const double* inputs = &input_grams[l](s0, t0 + t);
          for (Index s = 0; s < num_s; ++s) {
            std::fill_n(scale.data() + s * r, r, inputs[s]);
          }
          for (Index col = t * r; col < (t + 1) * r; ++col) {
            const auto product = scale.head(height).cwiseProduct(
                delta_gram.col(col).head(height));
            auto sum = JJt->col(t0 * r + col).segment(s0 * r, height);
            if (l == 0) {
              sum = product;
            } else {
              sum += product;
            }
          }
        }
      }
    }
  }
}

void NetworkJacobian::ToDense(MatrixXd* J) const {
  const std::vector<int>& widths = network_.widths();
  const Index r = outputs_per_sample_;
  J->resize(rows(), cols());
  MatrixXd inputs;  // m x (widths[l] + 1): row (s, j) is a_{l,s}
  MatrixXd deltas;  // m x widths[l + 1]
  for (int l = 0; l < network_.num_layers(); ++l) {
    const Index fan_in = widths[l] + 1;
    inputs.resize(rows(), fan_in);
    for (int s = 0; s < activations_.batch_size(); ++s) {
      inputs.middleRows(s * r, r) =
          activations_.inputs[l].col(s).transpose().replicate(r, 1);
    }
    deltas = LayerFactor(l).transpose();
    for (int unit = 0; unit < widths[l + 1]; ++unit) {
      const Index first = network_.offset(l) + unit * fan_in;
      J->middleCols(first, fan_in).array() =
          inputs.array().colwise() * deltas.col(unit).array();
    }
  }
}

std::string NetworkJacobian::RowName(int row) const {
  return JacobianOperator::RowName(row) + " (sample " +
         std::to_string(row / outputs_per_sample_) + ", output " +
         std::to_string(row % outputs_per_sample_) + ")";
}

}  // namespace invgrad
