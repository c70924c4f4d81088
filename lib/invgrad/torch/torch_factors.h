// The Kronecker factors (core/sampled_factors.h) of the layers in a graph of
// libtorch (torch_layers.h).
#ifndef INVGRAD_TORCH_TORCH_FACTORS_H_
#define INVGRAD_TORCH_TORCH_FACTORS_H_

#include <vector>

#include "invgrad/internal/sampled_factors.h"
#include "torch/torch.h"

namespace invgrad {

// The layers in the graph of `output`, in the order of their weights.
std::vector<LayerColumns> FactorLayerColumns(
    const torch::Tensor& output, const std::vector<torch::Tensor>& parameters);

// The factors for covectors of the output, of its shape. Keeps the graph.
SampledFactors TorchFactors(const torch::Tensor& output,
                            const torch::Tensor& covectors,
                            const std::vector<torch::Tensor>& parameters);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_FACTORS_H_
