#include "invgrad/torch_network.h"

#include <algorithm>
#include <mutex>
#include <numeric>
#include <optional>

#include "ATen/CPUGeneratorImpl.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/random.h"
#include "invgrad/torch/peak_memory.h"
#include "invgrad/torch/torch_factors.h"
#include "invgrad/torch/torch_message.h"
#include "invgrad/torch/torch_output_layer.h"
#include "invgrad/torch/torch_tensors.h"
#include "invgrad/torch/torch_trial.h"
#include "torch/csrc/autograd/forward_grad.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;

int64_t Product(const std::vector<int64_t>& shape) {
  return std::accumulate(
      shape.begin(), shape.end(), int64_t{1}, std::multiplies<>());
}

// Memory of a step, over that of its tensors: what oneDNN allocates itself, and
// gaps between tensors. Measured for a U-net on 64 x 64 cells, B = 128: 1.4.
constexpr double kMemoryOverTensors = 1.5;

// The levels of dual numbers are global.
class DualLevel {
 public:
  DualLevel() : index_(torch::autograd::ForwardADLevel::get_next_idx()) {}
  ~DualLevel() { torch::autograd::ForwardADLevel::release_idx(index_); }
  DualLevel(const DualLevel&) = delete;
  DualLevel& operator=(const DualLevel&) = delete;
  uint64_t index() const { return index_; }

 private:
  uint64_t index_;
};

class TorchNetwork final : public Network,
                           public LinearOutputNetwork,
                           public FactoredNetwork,
                           public InputDifferentiableNetwork {
 public:
  // Returns null, with *error set.
  static std::shared_ptr<const TorchNetwork> Make(
      const std::function<TorchFunction()>& make,
      const TorchNetworkOptions& options,
      std::string* error);

  int num_inputs() const override {
    return static_cast<int>(Product(options_.input_shape));
  }
  int num_outputs() const override {
    return static_cast<int>(Product(output_shape_));
  }
  int num_weights() const override {
    return static_cast<int>(initial_weights_.size());
  }
  std::string Name() const override { return name_; }
  VectorXd InitialWeights(Initialization initialization,
                          NumpyRandom* random) const override;
  std::vector<int> WeightBlocks() const override;
  bool couples_samples() const override { return true; }
  LayerColumns OutputLayer() const override { return output_layer_; }
  MatrixXd Features(const VectorXd& weights, const Pass& pass) const override;
  std::vector<LayerColumns> FactorLayers() const override {
    return factor_layers_;
  }

  struct TorchPass final : Pass {
    Tensor input;
    // With the graph of derivatives; undefined for Derivatives::kNone.
    mutable Tensor output;
    mutable long weights_id = -1;  // of the graph
  };
  std::unique_ptr<Pass> NewPass() const override {
    return std::make_unique<TorchPass>();
  }
  bool Forward(const VectorXd& weights,
               const MatrixXd& inputs,
               Derivatives derivatives,
               Pass* pass,
               std::string* error) const override;
  void Backward(const VectorXd& weights,
                const Pass& pass,
                const MatrixXd& output_covectors,
                VectorXd* gradient) const override;
  void Tangent(const VectorXd& weights,
               const Pass& pass,
               const VectorXd& weight_tangent,
               MatrixXd* output_tangents) const override;
  void Factors(const VectorXd& weights,
               const Pass& pass,
               const MatrixXd& output_covectors,
               SampledFactors* factors) const override;
  bool InputJacobian(const VectorXd& weights,
                     const VectorXd& input,
                     VectorXd* outputs,
                     MatrixXd* jacobian,
                     std::string* error) const override;

 private:
  TorchNetwork(const std::function<TorchFunction()>& make,
               const TorchNetworkOptions& options)
      : make_(make), options_(options) {}

  // Parts of Make.
  bool TakeParameters(std::string* error);
  void Measure();

  torch::ScalarType type() const {
    return options_.double_precision ? torch::kDouble : torch::kFloat;
  }
  // A copy, of shape (cols, rows).
  Tensor ToTensor(const MatrixXd& columns) const {
    return torch::from_blob(const_cast<double*>(columns.data()),
                            {columns.cols(), columns.rows()},
                            torch::kDouble)
        .to(type(), /*non_blocking=*/false, /*copy=*/true);
  }
  Tensor ToInput(const MatrixXd& inputs) const {
    std::vector<int64_t> shape = options_.input_shape;
    shape.insert(shape.begin(), inputs.cols());
    return ToTensor(inputs).view(shape);
  }
  // Views of a vector with the shapes of the parameters.
  std::vector<Tensor> Split(const VectorXd& vector) const;

  void SetWeights(const VectorXd& weights) const;
  // The output of a pass at these weights, with its graph.
  const Tensor& Differentiable(const VectorXd& weights,
                               const TorchPass& pass) const;

  const std::function<TorchFunction()> make_;
  const TorchNetworkOptions options_;
  std::string name_;
  std::vector<int64_t> output_shape_;
  VectorXd initial_weights_;
  LayerColumns output_layer_;
  std::vector<LayerColumns> factor_layers_;

  mutable std::mutex mutex_;  // of the following
  mutable TorchFunction function_;
  std::vector<Tensor> parameters_;
  mutable VectorXd weights_;     // in parameters_
  mutable long weights_id_ = 0;  // counts the changes of weights_
};

// Only these are weights.
std::vector<Tensor> TrainableParameters(const TorchFunction& function) {
  std::vector<Tensor> tensors;
  for (const auto& [name, tensor] : function.parameters) {
    if (tensor.requires_grad()) tensors.push_back(tensor);
  }
  return tensors;
}

std::vector<Tensor> TorchNetwork::Split(const VectorXd& vector) const {
  const Tensor all = ToTensor(vector).view({-1});
  std::vector<Tensor> parts;
  int64_t first = 0;
  for (const Tensor& parameter : parameters_) {
    parts.push_back(
        all.narrow(0, first, parameter.numel()).view(parameter.sizes()));
    first += parameter.numel();
  }
  return parts;
}

bool TorchNetwork::TakeParameters(std::string* error) {
  for (auto* tensors : {&function_.parameters, &function_.buffers}) {
    for (auto& [name, tensor] : *tensors) {
      if (tensor.is_floating_point()) tensor.set_data(tensor.to(type()));
    }
  }
  parameters_ = TrainableParameters(function_);
  if (parameters_.empty()) {
    *error = "the module has no parameters that need a gradient";
    return false;
  }
  initial_weights_ = weights_ = Flatten(parameters_);
  return true;
}

void TorchNetwork::Measure() {
  // Linear in the number of samples.
  const auto peak = [this](int num_samples) {
    const MatrixXd inputs = MatrixXd::Constant(num_inputs(), num_samples, 0.5);
    const MatrixXd outputs = MatrixXd::Ones(num_outputs(), num_samples);
    VectorXd gradient;
    TorchPass pass;
    std::string error;
    const PeakMemory memory;
    if (Forward(initial_weights_, inputs, Derivatives::kFirst, &pass, &error)) {
      Backward(initial_weights_, pass, outputs, &gradient);
    }
    const double bytes = memory.bytes();
    try {
      if (pass.output.defined()) {
        factor_layers_ = FactorLayerColumns(pass.output, parameters_);
        output_layer_ = TorchOutputLayer(pass.output, parameters_);
      }
    } catch (const std::exception& exception) {
      // For example inputs that the module overwrites.
      factor_layers_ = {};
      output_layer_ = {};
    }
    return bytes;
  };
  const double of_two = peak(2);
  set_bytes_per_column(kMemoryOverTensors * (peak(4) - of_two) / 2.0 +
                       2.0 * sizeof(double) * (num_inputs() + num_outputs()));
}

std::shared_ptr<const TorchNetwork> TorchNetwork::Make(
    const std::function<TorchFunction()>& make,
    const TorchNetworkOptions& options,
    std::string* error) {
  const std::shared_ptr<TorchNetwork> network(new TorchNetwork(make, options));
  const double size = static_cast<double>(Product(options.input_shape));
  if (options.input_shape.empty() || !(size > 0.0)) {
    *error = "the shape of a sample must have positive sizes, found " +
             ShapeText(options.input_shape);
    return nullptr;
  }
  try {
    network->function_ = make();
  } catch (const std::exception& exception) {
    *error = TorchMessage(exception);
    return nullptr;
  }
  const MatrixXd trial = VectorXd::LinSpaced(2 * network->num_inputs(), -1, 1)
                             .reshaped(network->num_inputs(), 2);
  if (!network->TakeParameters(error) || !TryForward(network->function_,
                                                     network->ToInput(trial),
                                                     &network->output_shape_,
                                                     error)) {
    return nullptr;
  }
  network->Measure();
  network->name_ = options.name + ", " +
                   std::to_string(network->num_weights()) + " weights, " +
                   ShapeText(options.input_shape) + " to " +
                   ShapeText(network->output_shape_) +
                   (options.double_precision ? ", double" : ", single");
  return network;
}

// Seeds the random numbers that a module's constructor draws, and gives the
// program its generator back as it was.
class SeededGenerator {
 public:
  explicit SeededGenerator(uint64_t seed)
      : generator_(at::detail::getDefaultCPUGenerator()) {
    const std::lock_guard<std::mutex> lock(generator_.mutex());
    before_ = generator_.get_state();
    generator_.set_current_seed(seed);
  }
  ~SeededGenerator() {
    const std::lock_guard<std::mutex> lock(generator_.mutex());
    generator_.set_state(before_);
  }
  SeededGenerator(const SeededGenerator&) = delete;
  SeededGenerator& operator=(const SeededGenerator&) = delete;

 private:
  at::Generator generator_;
  Tensor before_;
};

VectorXd TorchNetwork::InitialWeights(Initialization /*initialization*/,
                                      NumpyRandom* random) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SeededGenerator seeded(
      static_cast<uint64_t>(random->Rand() * 4294967296.0));
  return Flatten(TrainableParameters(make_()));
}

std::vector<int> TorchNetwork::WeightBlocks() const {
  std::vector<int> blocks;
  for (const Tensor& parameter : parameters_) {
    blocks.push_back(static_cast<int>(parameter.numel()));
  }
  return blocks;
}

void TorchNetwork::SetWeights(const VectorXd& weights) const {
  CHECK_EQ(weights.size(), num_weights());
  if (weights == weights_) return;
  const torch::NoGradGuard guard;
  const std::vector<Tensor> values = Split(weights);
  for (size_t i = 0; i < parameters_.size(); ++i) {
    Tensor(parameters_[i]).copy_(values[i]);
  }
  weights_ = weights;
  ++weights_id_;
}

bool TorchNetwork::Forward(const VectorXd& weights,
                           const MatrixXd& inputs,
                           Derivatives derivatives,
                           Pass* pass,
                           std::string* error) const {
  CHECK_EQ(inputs.rows(), num_inputs());
  CHECK(derivatives != Derivatives::kSecond)
      << "a network of libtorch has first derivatives only";
  auto* torch_pass = dynamic_cast<TorchPass*>(pass);
  CHECK(torch_pass != nullptr) << "The pass is of another network.";
  const std::lock_guard<std::mutex> lock(mutex_);
  SetWeights(weights);
  torch_pass->output.reset();  // frees the graph before the next one grows
  torch_pass->input = ToInput(inputs);
  try {
    const torch::AutoGradMode mode(derivatives != Derivatives::kNone);
    torch_pass->output = function_.forward(torch_pass->input);
    torch_pass->weights_id = weights_id_;
  } catch (const std::exception& exception) {
    *error = "the network fails: " + TorchMessage(exception);
    return false;
  }
  torch_pass->outputs = ToColumns(torch_pass->output);
  if (derivatives == Derivatives::kNone) torch_pass->output.reset();
  return true;
}

const Tensor& TorchNetwork::Differentiable(const VectorXd& weights,
                                           const TorchPass& pass) const {
  SetWeights(weights);
  if (!pass.output.defined() || pass.weights_id != weights_id_) {
    pass.output.reset();
    const torch::AutoGradMode mode(true);
    pass.output = function_.forward(pass.input);
    pass.weights_id = weights_id_;
  }
  return pass.output;
}

void TorchNetwork::Backward(const VectorXd& weights,
                            const Pass& pass,
                            const MatrixXd& output_covectors,
                            VectorXd* gradient) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), pass.num_columns());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const Tensor& output = Differentiable(weights, torch_pass);
    std::vector<Tensor> gradients =
        torch::autograd::grad({output},
                              parameters_,
                              {ToTensor(output_covectors).view(output.sizes())},
                              /*retain_graph=*/true,
                              /*create_graph=*/false,
                              /*allow_unused=*/true);
    for (size_t i = 0; i < gradients.size(); ++i) {
      if (!gradients[i].defined()) {
        gradients[i] = torch::zeros_like(parameters_[i]);
      }
    }
    *gradient = Flatten(gradients);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's gradient fails: " << TorchMessage(exception);
    gradient->setConstant(num_weights(), NAN);
  }
}

void TorchNetwork::Tangent(const VectorXd& weights,
                           const Pass& pass,
                           const VectorXd& weight_tangent,
                           MatrixXd* output_tangents) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(weight_tangent.size(), num_weights());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    SetWeights(weights);
    const torch::NoGradGuard guard;
    const std::vector<Tensor> tangents = Split(weight_tangent);
    const DualLevel level;
    for (size_t i = 0; i < parameters_.size(); ++i) {
      parameters_[i]._set_fw_grad(
          tangents[i], level.index(), /*is_inplace_op=*/false);
    }
    const Tensor tangent =
        function_.forward(torch_pass.input)._fw_grad(level.index());
    if (tangent.defined()) {
      *output_tangents = ToColumns(tangent);
    } else {
      output_tangents->setZero(num_outputs(), pass.num_columns());
    }
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's tangent fails: " << TorchMessage(exception);
    output_tangents->setConstant(num_outputs(), pass.num_columns(), NAN);
  }
}

MatrixXd TorchNetwork::Features(const VectorXd& weights,
                                const Pass& pass) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_GT(output_layer_.size(), 0) << "the network has no output layer";
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    return TorchFeatures(Differentiable(weights, torch_pass), parameters_);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's features fail: " << TorchMessage(exception);
    return MatrixXd::Constant(
        output_layer_.rows(), pass.outputs.size() / output_layer_.cols(), NAN);
  }
}

void TorchNetwork::Factors(const VectorXd& weights,
                           const Pass& pass,
                           const MatrixXd& output_covectors,
                           SampledFactors* factors) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), pass.num_columns());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const Tensor& output = Differentiable(weights, torch_pass);
    *factors = TorchFactors(
        output, ToTensor(output_covectors).view(output.sizes()), parameters_);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's factors fail: " << TorchMessage(exception);
    *factors = {};
    factors->others.setConstant(num_weights(), NAN);
  }
}

bool TorchNetwork::InputJacobian(const VectorXd& weights,
                                 const VectorXd& input,
                                 VectorXd* outputs,
                                 MatrixXd* jacobian,
                                 std::string* error) const {
  CHECK_EQ(input.size(), num_inputs());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    SetWeights(weights);
    const torch::AutoGradMode mode(true);
    const Tensor differentiable = ToInput(input).requires_grad_();
    const Tensor output = function_.forward(differentiable);
    *outputs = ToColumns(output).col(0);
    const Tensor flat = output.view({-1});
    jacobian->resize(num_outputs(), num_inputs());
    for (int i = 0; i < num_outputs(); ++i) {
      const std::vector<Tensor> row =
          torch::autograd::grad({flat[i]},
                                {differentiable},
                                /*grad_outputs=*/{},
                                /*retain_graph=*/true);
      jacobian->row(i) = ToColumns(row[0]).col(0).transpose();
    }
  } catch (const std::exception& exception) {
    *error = "the network fails: " + TorchMessage(exception);
    return false;
  }
  return true;
}

}  // namespace

std::shared_ptr<const Network> MakeTorchNetwork(
    const std::function<TorchFunction()>& make,
    const TorchNetworkOptions& options,
    std::string* error) {
  return TorchNetwork::Make(make, options, error);
}

}  // namespace invgrad
