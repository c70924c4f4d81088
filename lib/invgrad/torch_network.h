// A network of libtorch: any torch::nn::Module or TorchScript file.
//
//   x = f(a; theta)
//
// Shapes:  theta: all parameters that need a gradient, in the order of
//          named_parameters, each row by row. A column of a and of x is a
//          sample, the tensor of input_shape or of the module's output without
//          its first dimension, row by row; the module maps (B, input_shape) to
//          (B, ...).
// Units:   weights, inputs and outputs are doubles; the module computes in
//          single precision (a relative error of about 1e-6) or, 10 to 25 times
//          slower for convolutions, in double precision.
// Cost:    Backward: the module's backward pass. Tangent: a forward pass with
//          dual numbers (forward-mode differentiation), 3 times a forward pass.
//          The alternative, two backward passes, costs 4 times as much.
//          Factors: of 2D convolutions and linear layers (torch_layers.h), a
//          backward pass, and a product of all patches with themselves.
//          OutputLayer: see torch_output_layer.h.
//          glibc returns the memory of large tensors to the system at every
//          step: mallopt(M_MMAP_MAX, 0) and mallopt(M_TRIM_THRESHOLD, INT_MAX)
//          at the start of a program halved the time of a U-net's step.
// Fails:   the functions that make a network return null, with *error set. A
//          pass that throws, for example for want of memory, is a failure with
//          its message; a derivative that throws is NaN, with a logged message.
// One network computes one thing at a time: threads that share it wait.
//
// Source: Paszke et al. PyTorch: An Imperative Style, High-Performance Deep
//         Learning Library. NeurIPS 2019.
#ifndef INVGRAD_TORCH_NETWORK_H_
#define INVGRAD_TORCH_NETWORK_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "invgrad/network.h"
#include "torch/torch.h"

namespace invgrad {

// A differentiable function of libtorch with its weights.
struct TorchFunction {
  using NamedTensors = std::vector<std::pair<std::string, torch::Tensor>>;

  NamedTensors parameters;
  NamedTensors buffers;
  std::function<torch::Tensor(const torch::Tensor& input)> forward;
};

struct TorchNetworkOptions {
  std::string name;                  // Network::Name
  std::vector<int64_t> input_shape;  // of a sample: {channels, rows, cols}
  bool double_precision = false;
};

// `make` returns the function with its initial weights; it is called once, and
// again for each seed, with libtorch's default generator seeded.
std::shared_ptr<const Network> MakeTorchNetwork(
    const std::function<TorchFunction()>& make,
    const TorchNetworkOptions& options,
    std::string* error);

// The function of a module with the method forward(torch::Tensor).
template <typename Module>
TorchFunction FunctionOfModule(std::shared_ptr<Module> module) {
  TorchFunction function;
  for (const auto& item : module->named_parameters()) {
    function.parameters.emplace_back(item.key(), item.value());
  }
  for (const auto& item : module->named_buffers()) {
    function.buffers.emplace_back(item.key(), item.value());
  }
  function.forward = [module](const torch::Tensor& input) {
    return module->forward(input);
  };
  return function;
}

// A network from a TorchScript file, which torch.jit.script or torch.jit.trace
// and save have written elsewhere.
//
// Its initial weights are those in the file, for every seed. Buffers must not
// change in a forward pass: export after eval(), or use batch normalization
// with track_running_stats=False.

// input_shape: of a sample, as the module takes it: {channels, rows, cols}.
// Returns null, with *error set ("file: ..."), if the file is no TorchScript,
// or the module does not fit.
std::shared_ptr<const Network> LoadTorchScript(
    const std::string& path,
    const std::vector<int64_t>& input_shape,
    bool double_precision,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_NETWORK_H_
