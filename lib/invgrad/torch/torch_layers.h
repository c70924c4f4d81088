// The layers in the graph of an output of libtorch.
//
//   z_t = W a_t + b   at each position t of all samples
//
// Layers are 2D convolutions of one group, whose a_t are the patches under the
// kernel, channel by channel, and linear layers. W is a parameter as it is: no
// function of parameters.
//
// Shapes:  W: fan_out x fan_in, a convolution's kernel row by row;  b: fan_out.
// Cost:    a walk over the graph.
// Fails:   InputsOf throws if the module has overwritten the inputs.
#ifndef INVGRAD_TORCH_TORCH_LAYERS_H_
#define INVGRAD_TORCH_TORCH_LAYERS_H_

#include <memory>
#include <vector>

#include "invgrad/internal/sampled_factors.h"
#include "torch/torch.h"

namespace invgrad {

using TorchNodes = std::vector<std::shared_ptr<torch::autograd::Node>>;

constexpr int kNoParameter = -1;

// A layer and its calls in the graph. Parameters are numbers.
struct TorchLayer {
  int weight = kNoParameter;
  int bias = kNoParameter;
  TorchNodes calls;  // the last one first
};

// In the order of their weights.
std::vector<TorchLayer> FindLayers(
    const torch::Tensor& output, const std::vector<torch::Tensor>& parameters);

// The nodes that these depend on, and these; null ones are left out.
TorchNodes NodesBehind(TorchNodes nodes);

// The inputs of a call: (samples, channels, rows, cols) of a convolution,
// (positions, fan_in) of a linear layer.
torch::Tensor InputsOf(const torch::autograd::Node& call);

// The a_t of some inputs of a call: (samples, fan_in, positions).
torch::Tensor PatchesOf(const torch::autograd::Node& call,
                        const torch::Tensor& weight,
                        const torch::Tensor& inputs);

// The first weight of each parameter, and the number of all weights.
std::vector<int> FirstColumns(const std::vector<torch::Tensor>& parameters);

LayerColumns ColumnsOf(const TorchLayer& layer,
                       const std::vector<torch::Tensor>& parameters);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_LAYERS_H_
