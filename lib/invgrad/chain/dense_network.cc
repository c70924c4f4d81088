#include "invgrad/chain/dense_network.h"

#include <cmath>
#include <limits>
#include <utility>

#include "glog/logging.h"
#include "invgrad/chain/two_jet.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using WeightMap = Eigen::Map<const MatrixXd>;

// A layer's weights, (widths[l] + 1) x widths[l + 1]: a column a unit, whose
// last entry is the bias.
WeightMap Layer(const DenseNetwork& network, int l, const VectorXd& weights) {
  return WeightMap(weights.data() + network.offset(l),
                   network.widths()[l] + 1,
                   network.widths()[l + 1]);
}

// A backward pass and its tangent, as the second derivatives need them. Entry l
// of each vector belongs to layer l.
struct TangentPass {
  std::vector<MatrixXd> deltas;      // dF/dz
  std::vector<MatrixXd> pulled;      // dF/da between layers l and l + 1
  std::vector<MatrixXd> z_dots;      // the tangents of z,
  std::vector<MatrixXd> a_dots;      // of the layers' inputs
  std::vector<MatrixXd> delta_dots;  // and of deltas
};

// Fills deltas and pulled, and gives the tangents their sizes.
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
      << "Forward was not asked for curvatures.";
  TangentPass pass;
  pass.deltas.resize(L);
  pass.pulled.resize(L);
  pass.deltas[L - 1] = output_covectors;
  for (int l = L - 1; l > 0; --l) {
    pass.pulled[l - 1].resize(widths[l], batch_size);
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         Layer(network, l, weights).topRows(widths[l]),
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

// z_dots and a_dots of the layers above `from`, from its z_dots.
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
         Layer(network, l, weights).topRows(network.widths()[l]),
         pass->a_dots[l],
         0.0,
         pass->z_dots[l]);
  }
}

// delta_dots of the layers from `from` on, from those of the last.
void TangentBackward(const DenseNetwork& network,
                     const VectorXd& weights,
                     const DenseNetwork::Activations& activations,
                     int from,
                     TangentPass* pass) {
  const int T = activations.num_channels;
  MatrixXd slope_dots;
  MatrixXd turned;  // what the change of the slopes adds
  for (int l = network.num_layers() - 1; l > from; --l) {
    MatrixXd& below = pass->delta_dots[l - 1];
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         Layer(network, l, weights).topRows(network.widths()[l]),
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

// The tangents of the samples' gradients in the weights of layer l, which are
// inputs_s delta_s^T: layer_size x B.
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

DenseNetwork::DenseNetwork(std::vector<int> widths, Activation hidden)
    : widths_(std::move(widths)), hidden_(hidden) {
  CHECK_GE(widths_.size(), 2u) << "A network has inputs and outputs.";
  for (const int width : widths_) CHECK_GT(width, 0);
  CHECK_LE(CountWeights(widths_), std::numeric_limits<int>::max());
  offsets_.push_back(0);
  for (std::size_t l = 0; l + 1 < widths_.size(); ++l) {
    offsets_.push_back(offsets_.back() + (widths_[l] + 1) * widths_[l + 1]);
  }
}

double DenseNetwork::CountWeights(const std::vector<int>& widths) {
  double count = 0.0;
  for (std::size_t l = 1; l < widths.size(); ++l) {
    count += (widths[l - 1] + 1.0) * widths[l];
  }
  return count;
}

VectorXd DenseNetwork::InitialWeights(Initialization initialization,
                                      NumpyRandom* random) const {
  CHECK(random != nullptr);
  VectorXd weights = VectorXd::Zero(num_weights());
  for (int l = 0; l < num_layers(); ++l) {
    const int fan_in = widths_[l];
    const int fan_out = widths_[l + 1];
    double bound = 0.0;
    switch (initialization) {
      case Initialization::kGlorotUniform:
        bound = std::sqrt(6.0 / (fan_in + fan_out));
        break;
      case Initialization::kHeUniform:
        bound = std::sqrt(6.0 / fan_in);
        break;
      case Initialization::kPytorch:
        bound = 1.0 / std::sqrt(fan_in);
        break;
    }
    Eigen::Map<MatrixXd> layer(
        weights.data() + offsets_[l], fan_in + 1, fan_out);
    for (int unit = 0; unit < fan_out; ++unit) {
      for (int i = 0; i < fan_in; ++i) {
        layer(i, unit) = random->Uniform(-bound, bound);
      }
    }
    if (initialization == Initialization::kPytorch) {
      for (int unit = 0; unit < fan_out; ++unit) {
        layer(fan_in, unit) = random->Uniform(-bound, bound);
      }
    }
  }
  return weights;
}

void DenseNetwork::Forward(const VectorXd& weights,
                           const MatrixXd& inputs,
                           bool want_curvatures,
                           Activations* activations) const {
  CHECK_EQ(inputs.rows(), num_inputs());
  activations->num_channels = 1;
  activations->inputs.resize(num_layers());
  activations->inputs[0].resize(num_inputs() + 1, inputs.cols());
  activations->inputs[0].topRows(num_inputs()) = inputs;
  RunLayers(weights, want_curvatures, activations);
}

void DenseNetwork::ForwardJets(const VectorXd& weights,
                               const MatrixXd& inputs,
                               bool want_curvatures,
                               Activations* activations) const {
  CHECK_EQ(inputs.rows(), num_inputs());
  CHECK(hidden_ != Activation::kRelu) << "ReLU has no Laplacian.";
  const int num_channels = NumTwoJetChannels(num_inputs());
  activations->num_channels = num_channels;
  activations->inputs.resize(num_layers());
  activations->inputs[0].resize(num_inputs() + 1, num_channels * inputs.cols());
  activations->inputs[0].topRows(num_inputs()) = JetsOfInputs(inputs);
  RunLayers(weights, want_curvatures, activations);
}

void DenseNetwork::RunLayers(const VectorXd& weights,
                             bool want_curvatures,
                             Activations* activations) const {
  CHECK_EQ(weights.size(), num_weights());
  const int batch_size = static_cast<int>(activations->inputs[0].cols());
  const int num_channels = activations->num_channels;
  activations->slopes.resize(num_layers());
  activations->curvatures.resize(want_curvatures ? num_layers() : 0);
  const auto set_ones = [&](MatrixXd* a) {
    a->bottomRows(1).setZero();
    for (int s = 0; s < batch_size; s += num_channels) {
      (*a)(a->rows() - 1, s) = 1.0;
    }
  };
  set_ones(&activations->inputs[0]);
  for (int l = 0; l + 1 < num_layers(); ++l) {
    const int width = widths_[l + 1];
    MatrixXd& above = activations->inputs[l + 1];
    MatrixXd& slopes = activations->slopes[l];
    above.resize(width + 1, batch_size);
    set_ones(&above);
    slopes.resize(width, batch_size);
    if (want_curvatures) {
      activations->curvatures[l].resize(width, batch_size);
    }
    Gemm(Op::kTranspose,
         Op::kNone,
         1.0,
         Layer(*this, l, weights),
         activations->inputs[l],
         0.0,
         above.topRows(width));
    ActivateJets(hidden_,
                 num_channels,
                 above.topRows(width),
                 &slopes,
                 want_curvatures ? &activations->curvatures[l] : nullptr);
  }
  activations->outputs.resize(num_outputs(), batch_size);
  Gemm(Op::kTranspose,
       Op::kNone,
       1.0,
       Layer(*this, num_layers() - 1, weights),
       activations->inputs.back(),
       0.0,
       activations->outputs);
}

void DenseNetwork::Backward(const VectorXd& weights,
                            const Activations& activations,
                            const MatrixXd& output_covectors,
                            VectorXd* gradient) const {
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), activations.batch_size());
  gradient->resize(num_weights());
  const MatrixXd* delta = &output_covectors;  // dF/dz_l
  MatrixXd buffers[2];
  for (int l = num_layers() - 1; l >= 0; --l) {
    Eigen::Map<MatrixXd> layer_gradient(
        gradient->data() + offsets_[l], widths_[l] + 1, widths_[l + 1]);
    Gemm(Op::kNone,
         Op::kTranspose,
         1.0,
         activations.inputs[l],
         *delta,
         0.0,
         layer_gradient);
    if (l == 0) return;
    MatrixXd& below = buffers[l % 2];
    below.resize(widths_[l], activations.batch_size());
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         Layer(*this, l, weights).topRows(widths_[l]),
         *delta,
         0.0,
         below);
    MultiplyJetsTransposed(
        activations.num_channels, activations.slopes[l - 1], below);
    delta = &below;
  }
}

void DenseNetwork::InputJacobians(const VectorXd& weights,
                                  const Activations& activations,
                                  MatrixXd* jacobians) const {
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(activations.num_channels, 1);
  const int last = num_layers() - 1;
  const int batch_size = activations.batch_size();
  // dx_{s,i}/da_l, from the top: of the last layer's inputs it is the weights.
  MatrixXd above = Layer(*this, last, weights)
                       .topRows(widths_[last])
                       .replicate(1, batch_size);
  for (int l = last; l > 0; --l) {
    for (Eigen::Index column = 0; column < above.cols(); ++column) {
      above.col(column).array() *=
          activations.slopes[l - 1].col(column / num_outputs()).array();
    }
    MatrixXd below(widths_[l - 1], above.cols());
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         Layer(*this, l - 1, weights).topRows(widths_[l - 1]),
         above,
         0.0,
         below);
    above.swap(below);
  }
  jacobians->swap(above);
}

void DenseNetwork::Tangent(const VectorXd& weights,
                           const Activations& activations,
                           const VectorXd& weight_tangent,
                           MatrixXd* output_tangents) const {
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(weight_tangent.size(), num_weights());
  MatrixXd below;  // da_l
  for (int l = 0; l < num_layers(); ++l) {
    MatrixXd above(widths_[l + 1], activations.batch_size());
    Gemm(Op::kTranspose,
         Op::kNone,
         1.0,
         Layer(*this, l, weight_tangent),
         activations.inputs[l],
         0.0,
         above);
    if (l > 0) {
      Gemm(Op::kTranspose,
           Op::kNone,
           1.0,
           Layer(*this, l, weights).topRows(widths_[l]),
           below,
           1.0,
           above);
    }
    if (l + 1 < num_layers()) {
      MultiplyJets(activations.num_channels, activations.slopes[l], above);
    }
    below.swap(above);
  }
  output_tangents->swap(below);
}

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
    // This channel of the unit's z moves at rate one in every sample.
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

void DenseNetwork::InputSecondDerivatives(const VectorXd& weights,
                                          const Activations& activations,
                                          const MatrixXd& output_covectors,
                                          int i,
                                          MatrixXd* in_inputs,
                                          MatrixXd* in_weights) const {
  CHECK_GE(i, 0);
  CHECK_LT(i, num_inputs());
  CHECK_EQ(activations.num_channels, 1);
  const int batch_size = activations.batch_size();
  TangentPass pass =
      StartTangentPass(*this, weights, activations, output_covectors);
  const WeightMap first = Layer(*this, 0, weights);
  pass.a_dots[0].setZero();
  pass.a_dots[0].row(i).setOnes();
  pass.z_dots[0].colwise() = first.row(i).transpose();
  TangentForward(*this, weights, activations, 0, &pass);
  pass.delta_dots.back().setZero();  // w stays
  TangentBackward(*this, weights, activations, 0, &pass);
  in_inputs->resize(num_inputs(), batch_size);
  Gemm(Op::kNone,
       Op::kNone,
       1.0,
       first.topRows(num_inputs()),
       pass.delta_dots[0],
       0.0,
       *in_inputs);
  in_weights->resize(num_weights(), batch_size);
  for (int l = 0; l < num_layers(); ++l) {
    GradientTangents(activations,
                     pass,
                     l,
                     in_weights->middleRows(offsets_[l], layer_size(l)));
  }
}

std::string DenseNetwork::Name() const {
  std::string name = std::to_string(widths_.front());
  for (std::size_t l = 1; l < widths_.size(); ++l) {
    name += "-" + std::to_string(widths_[l]);
  }
  return name + " " + ActivationName(hidden_);
}

}  // namespace invgrad
