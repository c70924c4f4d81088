// DenseNetwork::Hessian.

#include "invgrad/dense_network.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A backward pass and its tangent. Entry l of each vector belongs to layer l.
class DenseNetwork::HessianPass {
 public:
  HessianPass(const DenseNetwork& network,
              const VectorXd& weights,
              const Activations& activations,
              const MatrixXd& output_covectors)
      : network_(network), weights_(weights), activations_(activations) {
    const int L = network.num_layers();
    const int num_columns = activations.num_columns();
    deltas_.resize(L);
    pulled_.resize(L);
    deltas_[L - 1] = output_covectors;
    for (int l = L - 1; l > 0; --l) {
      pulled_[l - 1].resize(network.widths_[l], num_columns);
      network.ApplyLayerTransposed(l, weights, deltas_[l], pulled_[l - 1]);
      deltas_[l - 1] = pulled_[l - 1];
      activations.derivatives->MultiplyTransposed(activations.slopes[l - 1],
                                                  deltas_[l - 1]);
    }
    z_dots_.resize(L);
    a_dots_.resize(L);
    delta_dots_.resize(L);
    for (int l = 0; l < L; ++l) {
      z_dots_[l].resize(network.widths_[l + 1], num_columns);
      a_dots_[l].resize(network.widths_[l], num_columns);
      delta_dots_[l].resize(network.widths_[l + 1], num_columns);
    }
  }

  // Computes the tangents if this channel of the z of a unit of layer `from`
  // has the tangent one in every sample.
  void Run(int from,
           int unit,
           int channel,
           const std::vector<MatrixXd>& output_hessians) {
    const DerivativeSet& jets = *activations_.derivatives;
    const int T = jets.num_channels();
    const auto batch_size = static_cast<Index>(output_hessians.size());
    z_dots_[from].setZero();
    for (Index s = 0; s < batch_size; ++s) {
      z_dots_[from](unit, s * T + channel) = 1.0;
    }
    a_dots_[from].setZero();
    const int last = network_.num_layers() - 1;
    for (int l = from + 1; l <= last; ++l) {
      a_dots_[l] = z_dots_[l - 1];
      jets.Multiply(activations_.slopes[l - 1], a_dots_[l]);
      network_.ApplyLayer(l, weights_, a_dots_[l], 0.0, z_dots_[l]);
    }
    const Index num_x = z_dots_[last].rows() * T;
    const Eigen::Map<const MatrixXd> x_dots(
        z_dots_[last].data(), num_x, batch_size);
    Eigen::Map<MatrixXd> x_bar_dots(
        delta_dots_[last].data(), num_x, batch_size);
    for (Index s = 0; s < batch_size; ++s) {
      x_bar_dots.col(s).noalias() = output_hessians[s] * x_dots.col(s);
    }
    MatrixXd slope_dots;
    MatrixXd turned;  // the term of the changing slopes
    for (int l = last; l > from; --l) {
      MatrixXd& below = delta_dots_[l - 1];
      network_.ApplyLayerTransposed(l, weights_, delta_dots_[l], below);
      jets.MultiplyTransposed(activations_.slopes[l - 1], below);
      slope_dots = z_dots_[l - 1];
      jets.Multiply(activations_.curvatures[l - 1], slope_dots);
      turned = pulled_[l - 1];
      jets.MultiplyTransposed(slope_dots, turned);
      below += turned;
    }
  }

  // The tangents of the samples' gradients inputs_s delta_s^T with respect to
  // the weights of layer l: layer_size x B.
  void GradientTangents(int l, Eigen::Ref<MatrixXd> gradient_dots) const {
    const Index width = a_dots_[l].rows();
    const Index stride = width + 1;
    gradient_dots.setZero();
    for (int column = 0; column < activations_.num_columns(); ++column) {
      auto sum = gradient_dots.col(column / activations_.num_channels);
      for (Index i = 0; i < deltas_[l].rows(); ++i) {
        sum.segment(i * stride, stride) +=
            activations_.inputs[l].col(column) * delta_dots_[l](i, column);
        sum.segment(i * stride, width) +=
            a_dots_[l].col(column) * deltas_[l](i, column);
      }
    }
  }

 private:
  const DenseNetwork& network_;
  const VectorXd& weights_;
  const Activations& activations_;
  std::vector<MatrixXd> deltas_;      // dF/dz
  std::vector<MatrixXd> pulled_;      // dF/da between layers l and l + 1
  std::vector<MatrixXd> z_dots_;      // the tangents of z,
  std::vector<MatrixXd> a_dots_;      // of the layers' inputs
  std::vector<MatrixXd> delta_dots_;  // and of deltas
};

void DenseNetwork::Hessian(const VectorXd& weights,
                           const Activations& activations,
                           const MatrixXd& output_covectors,
                           const std::vector<MatrixXd>& output_hessians,
                           MatrixXd* hessian) const {
  const int L = num_layers();
  const int T = activations.num_channels;
  const int batch_size = activations.num_columns() / T;
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), activations.num_columns());
  CHECK_EQ(static_cast<int>(output_hessians.size()), batch_size);
  CHECK_EQ(static_cast<int>(activations.curvatures.size()), L)
      << "The Hessian needs Forward with want_curvatures.";
  HessianPass pass(*this, weights, activations, output_covectors);
  hessian->resize(num_weights(), num_weights());
  MatrixXd gradient_dots;  // layer_size x B, a column a sample
  const auto add_pass = [&](int from, int unit, int channel) {
    pass.Run(from, unit, channel, output_hessians);
    // Only layers from `from` on: there the weights act on the tangent
    // through z alone.
    const Index num_incoming = widths_[from] + 1;
    const Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>> inputs(
        activations.inputs[from].col(channel).data(),
        num_incoming,
        batch_size,
        Eigen::OuterStride<>(T * num_incoming));
    for (int l = from; l < L; ++l) {
      gradient_dots.resize(layer_size(l), batch_size);
      pass.GradientTangents(l, gradient_dots);
      Gemm(Op::kNone,
           Op::kTranspose,
           1.0,
           gradient_dots,
           inputs,
           channel == 0 ? 0.0 : 1.0,
           hessian->block(offsets_[l],
                          offsets_[from] + unit * num_incoming,
                          layer_size(l),
                          num_incoming));
    }
  };
  for (int from = 0; from < L; ++from) {
    for (int unit = 0; unit < widths_[from + 1]; ++unit) {
      for (int channel = 0; channel < T; ++channel) {
        add_pass(from, unit, channel);
      }
    }
  }
  hessian->triangularView<Eigen::StrictlyUpper>() = hessian->transpose();
}

}  // namespace invgrad
