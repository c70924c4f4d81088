#include "invgrad/torch/module_network.h"

#include <algorithm>
#include <optional>
#include <set>

#include "ATen/CPUGeneratorImpl.h"
#include "invgrad/internal/logging.h"
#include "invgrad/random.h"
#include "invgrad/torch/peak_memory.h"
#include "invgrad/torch/torch_factors.h"
#include "invgrad/torch/torch_message.h"
#include "invgrad/torch/torch_output_layer.h"
#include "invgrad/torch/torch_tensors.h"
#include "invgrad/torch/torch_trial.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;

// Memory of a step, over that of its tensors: what oneDNN allocates itself, and
// gaps between tensors. Measured for a U-net on 64 x 64 cells, B = 128: 1.4.
constexpr double kMemoryOverTensors = 1.5;

// Only these are weights. A tensor that two layers share has two names.
std::vector<Tensor> TrainableParameters(const TorchFunction& function) {
  std::vector<Tensor> tensors;
  std::set<const void*> seen;
  for (const auto& [name, tensor] : function.parameters) {
    if (tensor.requires_grad() &&
        seen.insert(tensor.unsafeGetTensorImpl()).second) {
      tensors.push_back(tensor);
    }
  }
  return tensors;
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

}  // namespace

std::vector<Tensor> ModuleNetwork::Split(const VectorXd& vector) const {
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

bool ModuleNetwork::TakeParameters(std::string* error) {
  for (auto* tensors : {&function_.parameters, &function_.buffers}) {
    for (auto& [name, tensor] : *tensors) {
      if (!tensor.device().is_cpu()) {
        *error = name + " is on the device " + tensor.device().str() +
                 ": move the module to the CPU";
        return false;
      }
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

void ModuleNetwork::Measure() {
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

std::shared_ptr<const ModuleNetwork> ModuleNetwork::Make(
    const std::function<TorchFunction()>& make,
    const TorchNetworkOptions& options,
    std::string* error) {
  const std::shared_ptr<ModuleNetwork> network(
      new ModuleNetwork(make, options));
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

VectorXd ModuleNetwork::InitialWeights(Initialization /*initialization*/,
                                       NumpyRandom* random) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SeededGenerator seeded(
      static_cast<uint64_t>(random->Rand() * 4294967296.0));
  return Flatten(TrainableParameters(make_()));
}

std::vector<int> ModuleNetwork::WeightBlocks() const {
  std::vector<int> blocks;
  for (const Tensor& parameter : parameters_) {
    blocks.push_back(static_cast<int>(parameter.numel()));
  }
  return blocks;
}

void ModuleNetwork::SetWeights(const VectorXd& weights) const {
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

std::shared_ptr<const Network> MakeTorchNetwork(
    const std::function<TorchFunction()>& make,
    const TorchNetworkOptions& options,
    std::string* error) {
  return ModuleNetwork::Make(make, options, error);
}

}  // namespace invgrad
