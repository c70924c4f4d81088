#include "invgrad/chain/dense_network.h"

#include <cmath>
#include <limits>
#include <utility>

#include "fmt/format.h"
#include "glog/logging.h"
#include "invgrad/chain/two_jet.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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

Eigen::Map<const MatrixXd> DenseNetwork::LayerWeights(
    int l, const VectorXd& weights) const {
  return {weights.data() + offsets_[l], widths_[l] + 1, widths_[l + 1]};
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
         LayerWeights(l, weights),
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
       LayerWeights(num_layers() - 1, weights),
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
         LayerWeights(l, weights).topRows(widths_[l]),
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
  // dx_{s,i}/da_l, from the last layer down: for the inputs of the last layer
  // it equals the weights.
  MatrixXd above = LayerWeights(last, weights)
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
         LayerWeights(l - 1, weights).topRows(widths_[l - 1]),
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
         LayerWeights(l, weight_tangent),
         activations.inputs[l],
         0.0,
         above);
    if (l > 0) {
      Gemm(Op::kTranspose,
           Op::kNone,
           1.0,
           LayerWeights(l, weights).topRows(widths_[l]),
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

std::string DenseNetwork::Name() const {
  return fmt::format("{} {}", fmt::join(widths_, "-"), ActivationName(hidden_));
}

}  // namespace invgrad
