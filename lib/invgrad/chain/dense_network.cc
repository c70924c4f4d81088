#include "invgrad/dense_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"
#include "invgrad/random.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

DenseNetwork::DenseNetwork(std::vector<int> widths, Activation hidden)
    : widths_(std::move(widths)), hidden_(hidden) {
  CHECK_GE(widths_.size(), 2u) << "A network has inputs and outputs.";
  for (const int width : widths_) CHECK_GT(width, 0) << "a width is too small";
  CHECK_LE(CountWeights(widths_), std::numeric_limits<int>::max());
  offsets_.push_back(0);
  for (std::size_t l = 0; l + 1 < widths_.size(); ++l) {
    offsets_.push_back(offsets_.back() + (widths_[l] + 1) * widths_[l + 1]);
  }
  // Inputs, slopes and covectors of every layer.
  set_bytes_per_column(3.0 * sizeof(double) *
                       std::accumulate(widths_.begin(), widths_.end(), 0.0));
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
    const double bound = initialization == Initialization::kPytorch
                             ? 1.0 / std::sqrt(fan_in)
                         : initialization == Initialization::kHeUniform
                             ? std::sqrt(6.0 / fan_in)
                             : std::sqrt(6.0 / (fan_in + fan_out));
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

void DenseNetwork::ApplyLayer(int l,
                              const VectorXd& weights,
                              const MatrixXd& a,
                              double beta,
                              const Eigen::Ref<MatrixXd>& z) const {
  const auto W = LayerWeights(l, weights).topRows(a.rows());
  Gemm(Op::kTranspose, Op::kNone, 1.0, W, a, beta, z);
}

void DenseNetwork::ApplyLayerTransposed(
    int l,
    const VectorXd& weights,
    const MatrixXd& z_bar,
    const Eigen::Ref<MatrixXd>& a_bar) const {
  const auto W = LayerWeights(l, weights).topRows(widths_[l]);
  Gemm(Op::kNone, Op::kNone, 1.0, W, z_bar, 0.0, a_bar);
}

std::vector<int> DenseNetwork::WeightBlocks() const {
  std::vector<int> blocks;
  for (int l = 0; l < num_layers(); ++l) {
    blocks.insert(blocks.end(), widths_[l + 1], widths_[l] + 1);
  }
  return blocks;
}

bool DenseNetwork::Forward(const VectorXd& weights,
                           const MatrixXd& inputs,
                           Derivatives derivatives,
                           Pass* pass,
                           std::string* /*error*/) const {
  Forward(weights,
          inputs,
          derivatives == Derivatives::kSecond,
          dynamic_cast<Activations*>(pass));
  return true;
}

void DenseNetwork::Forward(const VectorXd& weights,
                           const MatrixXd& inputs,
                           bool want_curvatures,
                           Activations* activations) const {
  CHECK(activations != nullptr) << "The pass is of another network.";
  activations->derivatives = DerivativeSet::Values();
  activations->num_channels = 1;
  RunLayers(weights, inputs, want_curvatures, activations);
}

void DenseNetwork::ForwardJets(
    const VectorXd& weights,
    const std::shared_ptr<const DerivativeSet>& derivatives,
    const Eigen::Ref<const MatrixXd>& input_jets,
    bool want_curvatures,
    Activations* activations) const {
  CHECK(derivatives->order() < 2 || hidden_ != Activation::kRelu)
      << "ReLU has no second derivative: choose a smooth activation.";
  CHECK_EQ(input_jets.cols() % derivatives->num_channels(), 0);
  activations->derivatives = derivatives;
  activations->num_channels = derivatives->num_channels();
  RunLayers(weights, input_jets, want_curvatures, activations);
}

void DenseNetwork::RunLayers(const VectorXd& weights,
                             const Eigen::Ref<const MatrixXd>& inputs,
                             bool want_curvatures,
                             Activations* activations) const {
  CHECK_EQ(inputs.rows(), num_inputs()) << "inputs of another network";
  CHECK_EQ(weights.size(), num_weights()) << "weights of another network";
  const Eigen::Index num_columns = inputs.cols();
  const int num_channels = activations->num_channels;
  const int last = num_layers() - 1;
  activations->inputs.resize(num_layers());
  activations->slopes.resize(num_layers());
  activations->curvatures.resize(want_curvatures ? num_layers() : 0);
  const auto resize_with_ones = [&](int l) {
    MatrixXd& a = activations->inputs[l];
    a.resize(widths_[l] + 1, num_columns);
    a.bottomRows(1).setZero();
    for (Eigen::Index s = 0; s < num_columns; s += num_channels) {
      a(widths_[l], s) = 1.0;
    }
  };
  resize_with_ones(0);
  activations->inputs[0].topRows(num_inputs()) = inputs;
  for (int l = 0; l < last; ++l) {
    const int width = widths_[l + 1];
    resize_with_ones(l + 1);
    activations->slopes[l].resize(width, num_columns);
    if (want_curvatures) activations->curvatures[l].resize(width, num_columns);
    auto above = activations->inputs[l + 1].topRows(width);
    ApplyLayer(l, weights, activations->inputs[l], 0.0, above);
    activations->derivatives->Activate(
        hidden_,
        above,
        &activations->slopes[l],
        want_curvatures ? &activations->curvatures[l] : nullptr);
  }
  activations->outputs.resize(num_outputs(), num_columns);
  ApplyLayer(
      last, weights, activations->inputs[last], 0.0, activations->outputs);
}

void DenseNetwork::BackwardThroughLayer(int l,
                                        const VectorXd& weights,
                                        const Activations& activations,
                                        int calls,
                                        const MatrixXd& above,
                                        MatrixXd* below) const {
  below->resize(widths_[l], above.cols());
  ApplyLayerTransposed(l, weights, above, *below);
  const MatrixXd& slopes = activations.slopes[l - 1];
  const Eigen::Index per_sample = above.cols() / slopes.cols();
  if (per_sample == 1) calls = activations.num_columns();
  for (Eigen::Index first = 0; first < above.cols(); first += calls) {
    const Eigen::Index sample = first / (per_sample * calls);
    activations.derivatives->MultiplyTransposed(
        slopes.middleCols(sample * calls, calls),
        below->middleCols(first, calls));
  }
}

void DenseNetwork::Backward(const VectorXd& weights,
                            const Pass& pass,
                            const MatrixXd& output_covectors,
                            VectorXd* gradient) const {
  const auto& activations = dynamic_cast<const Activations&>(pass);
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), activations.num_columns());
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
    BackwardThroughLayer(
        l, weights, activations, activations.num_channels, *delta, &below);
    delta = &below;
  }
}

std::vector<LayerColumns> DenseNetwork::FactorLayers() const {
  std::vector<LayerColumns> layers;
  layers.reserve(num_layers());
  for (int l = 0; l < num_layers(); ++l) {
    layers.push_back(
        Eigen::VectorXi::LinSpaced(layer_size(l), offset(l), offset(l + 1) - 1)
            .reshaped(widths_[l] + 1, widths_[l + 1]));
  }
  return layers;
}

LayerColumns DenseNetwork::OutputLayer() const { return FactorLayers().back(); }

MatrixXd DenseNetwork::Features(const VectorXd& /*weights*/,
                                const Pass& pass) const {
  return dynamic_cast<const Activations&>(pass).inputs.back();
}

void DenseNetwork::Factors(const VectorXd& weights,
                           const Pass& pass,
                           const MatrixXd& output_covectors,
                           SampledFactors* factors) const {
  const auto& activations = dynamic_cast<const Activations&>(pass);
  CHECK_EQ(activations.num_channels, 1);
  CHECK_EQ(output_covectors.cols(), activations.num_columns());
  factors->layers.resize(num_layers());
  factors->others.setZero(num_weights());
  MatrixXd delta = output_covectors;
  MatrixXd below;
  for (int l = num_layers() - 1; l >= 0; --l) {
    const MatrixXd& a = activations.inputs[l];
    SampledFactors::Layer& layer = factors->layers[l];
    layer.A.resize(a.rows(), a.rows());
    layer.D.resize(delta.rows(), delta.rows());
    Gemm(Op::kNone,
         Op::kTranspose,
         1.0 / static_cast<double>(a.cols()),
         a,
         a,
         0.0,
         layer.A);
    Gemm(Op::kNone, Op::kTranspose, 1.0, delta, delta, 0.0, layer.D);
    if (l == 0) return;
    BackwardThroughLayer(l, weights, activations, 1, delta, &below);
    delta.swap(below);
  }
}

void DenseNetwork::InputJacobians(const VectorXd& weights,
                                  const Activations& activations,
                                  MatrixXd* jacobians) const {
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(activations.num_channels, 1);
  // dx_{s,i}/dz_l, from the last layer down.
  MatrixXd above = MatrixXd::Identity(num_outputs(), num_outputs())
                       .replicate(1, activations.num_columns());
  MatrixXd below;
  for (int l = num_layers() - 1; l > 0; --l) {
    BackwardThroughLayer(l, weights, activations, 1, above, &below);
    above.swap(below);
  }
  jacobians->resize(num_inputs(), above.cols());
  ApplyLayerTransposed(0, weights, above, *jacobians);
}

bool DenseNetwork::InputJacobian(const VectorXd& weights,
                                 const VectorXd& input,
                                 VectorXd* outputs,
                                 MatrixXd* jacobian,
                                 std::string* /*error*/) const {
  Activations activations;
  Forward(weights, input, /*want_curvatures=*/false, &activations);
  *outputs = activations.outputs.col(0);
  MatrixXd transposed;
  InputJacobians(weights, activations, &transposed);
  *jacobian = transposed.transpose();
  return true;
}

void DenseNetwork::Tangent(const VectorXd& weights,
                           const Pass& pass,
                           const VectorXd& weight_tangent,
                           MatrixXd* output_tangents) const {
  const auto& activations = dynamic_cast<const Activations&>(pass);
  CHECK_EQ(weights.size(), num_weights());
  CHECK_EQ(weight_tangent.size(), num_weights());
  MatrixXd below;  // da_l
  for (int l = 0; l < num_layers(); ++l) {
    MatrixXd above(widths_[l + 1], activations.num_columns());
    ApplyLayer(l, weight_tangent, activations.inputs[l], 0.0, above);
    if (l > 0) ApplyLayer(l, weights, below, 1.0, above);
    if (l + 1 < num_layers()) {
      activations.derivatives->Multiply(activations.slopes[l], above);
    }
    below.swap(above);
  }
  output_tangents->swap(below);
}

std::string DenseNetwork::Name() const {
  return fmt::format("{} {}", fmt::join(widths_, "-"), ActivationName(hidden_));
}

}  // namespace invgrad
