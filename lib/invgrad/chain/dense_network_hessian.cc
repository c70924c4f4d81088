// DenseNetwork::Hessian.

#include "glog/logging.h"
#include "invgrad/chain/dense_network.h"
#include "invgrad/chain/two_jet.h"
#include "invgrad/core/blas.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A backward pass and its tangent. Entry l of each vector belongs to layer l.
struct TangentPass {
  std::vector<MatrixXd> deltas;      // dF/dz
  std::vector<MatrixXd> pulled;      // dF/da between layers l and l + 1
  std::vector<MatrixXd> z_dots;      // the tangents of z,
  std::vector<MatrixXd> a_dots;      // of the layers' inputs
  std::vector<MatrixXd> delta_dots;  // and of deltas
};

// Fills deltas and pulled, and resizes the tangents.
TangentPass StartTangentPass(const DenseNetwork& network,
                             const VectorXd& weights,
                             const DenseNetwork::Activations& activations,
                             const MatrixXd& output_covectors) {
  const int L = network.num_layers();
  const int batch_size = activations.batch_size();
  const std::vector<int>& widths = network.widths();
  CHECK_EQ(weights.size(), network.num_weights());
  CHECK_EQ(output_covectors.rows(), network.num_outputs());
  CHECK_EQ(output_covectors.cols(), batch_size);
  CHECK_EQ(static_cast<int>(activations.curvatures.size()), L)
      << "The Hessian needs Forward with want_curvatures.";
  TangentPass pass;
  pass.deltas.resize(L);
  pass.pulled.resize(L);
  pass.deltas[L - 1] = output_covectors;
  for (int l = L - 1; l > 0; --l) {
    pass.pulled[l - 1].resize(widths[l], batch_size);
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         network.LayerWeights(l, weights).topRows(widths[l]),
         pass.deltas[l],
         0.0,
         pass.pulled[l - 1]);
    pass.deltas[l - 1] = pass.pulled[l - 1];
    MultiplyJetsTransposed(activations.num_channels,
                           activations.slopes[l - 1],
                           pass.deltas[l - 1]);
  }
  pass.z_dots.resize(L);
  pass.a_dots.resize(L);
  pass.delta_dots.resize(L);
  for (int l = 0; l < L; ++l) {
    pass.z_dots[l].resize(widths[l + 1], batch_size);
    pass.a_dots[l].resize(widths[l], batch_size);
    pass.delta_dots[l].resize(widths[l + 1], batch_size);
  }
  return pass;
}

// Computes z_dots and a_dots of the layers above `from` from the z_dots of
// `from`.
void TangentForward(const DenseNetwork& network,
                    const VectorXd& weights,
                    const DenseNetwork::Activations& activations,
                    int from,
                    TangentPass* pass) {
  for (int l = from + 1; l < network.num_layers(); ++l) {
    pass->a_dots[l] = pass->z_dots[l - 1];
    MultiplyJets(
        activations.num_channels, activations.slopes[l - 1], pass->a_dots[l]);
    Gemm(Op::kTranspose,
         Op::kNone,
         1.0,
         network.LayerWeights(l, weights).topRows(network.widths()[l]),
         pass->a_dots[l],
         0.0,
         pass->z_dots[l]);
  }
}

// Computes delta_dots of the layers from `from` on, starting at the last layer.
void TangentBackward(const DenseNetwork& network,
                     const VectorXd& weights,
                     const DenseNetwork::Activations& activations,
                     int from,
                     TangentPass* pass) {
  const int T = activations.num_channels;
  MatrixXd slope_dots;
  MatrixXd turned;  // the term of the changing slopes
  for (int l = network.num_layers() - 1; l > from; --l) {
    MatrixXd& below = pass->delta_dots[l - 1];
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         network.LayerWeights(l, weights).topRows(network.widths()[l]),
         pass->delta_dots[l],
         0.0,
         below);
    MultiplyJetsTransposed(T, activations.slopes[l - 1], below);
    slope_dots = pass->z_dots[l - 1];
    MultiplyJets(T, activations.curvatures[l - 1], slope_dots);
    turned = pass->pulled[l - 1];
    MultiplyJetsTransposed(T, slope_dots, turned);
    below += turned;
  }
}

// The tangents of the samples' gradients inputs_s delta_s^T with respect to the
// weights of layer l: layer_size x B.
void GradientTangents(const DenseNetwork::Activations& activations,
                      const TangentPass& pass,
                      int l,
                      Eigen::Ref<MatrixXd> gradient_dots) {
  const Eigen::Index width = pass.a_dots[l].rows();
  const Eigen::Index stride = width + 1;
  gradient_dots.setZero();
  for (int column = 0; column < activations.batch_size(); ++column) {
    auto sum = gradient_dots.col(column / activations.num_channels);
    for (Eigen::Index i = 0; i < pass.deltas[l].rows(); ++i) {
      sum.segment(i * stride, stride) +=
          activations.inputs[l].col(column) * pass.delta_dots[l](i, column);
      sum.segment(i * stride, width) +=
          pass.a_dots[l].col(column) * pass.deltas[l](i, column);
    }
  }
}

}  // namespace

void DenseNetwork::Hessian(const VectorXd& weights,
                           const Activations& activations,
                           const MatrixXd& output_covectors,
                           const std::vector<MatrixXd>& output_hessians,
                           MatrixXd* hessian) const {
  const int L = num_layers();
  const int T = activations.num_channels;
  const int batch_size = activations.batch_size() / T;
  CHECK_EQ(static_cast<int>(output_hessians.size()), batch_size);
  TangentPass pass =
      StartTangentPass(*this, weights, activations, output_covectors);
  hessian->resize(num_weights(), num_weights());
  MatrixXd gradient_dots;  // layer_size x B, a column a sample
  const auto add_pass = [&](int from, int unit, int channel) {
    // The tangent of this channel of the unit's z is one in every sample.
    pass.z_dots[from].setZero();
    for (int s = 0; s < batch_size; ++s) {
      pass.z_dots[from](unit, s * T + channel) = 1.0;
    }
    pass.a_dots[from].setZero();
    TangentForward(*this, weights, activations, from, &pass);
    const Eigen::Map<const MatrixXd> x_dots(
        pass.z_dots[L - 1].data(), num_outputs() * T, batch_size);
    Eigen::Map<MatrixXd> x_bar_dots(
        pass.delta_dots[L - 1].data(), num_outputs() * T, batch_size);
    for (int s = 0; s < batch_size; ++s) {
      x_bar_dots.col(s).noalias() = output_hessians[s] * x_dots.col(s);
    }
    TangentBackward(*this, weights, activations, from, &pass);
    // Only layers from `from` on: there the weights act on the tangent
    // through z alone.
    const Eigen::Index num_incoming = widths_[from] + 1;
    const Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>> inputs(
        activations.inputs[from].col(channel).data(),
        num_incoming,
        batch_size,
        Eigen::OuterStride<>(T * num_incoming));
    for (int l = from; l < L; ++l) {
      gradient_dots.resize(layer_size(l), batch_size);
      GradientTangents(activations, pass, l, gradient_dots);
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
