// The Kronecker factors (core/sampled_factors.h) of the layers in a graph of
// libtorch (torch_layers.h).
#ifndef INVGRAD_TORCH_TORCH_FACTORS_H_
#define INVGRAD_TORCH_TORCH_FACTORS_H_

#include <vector>

#include "invgrad/core/sampled_factors.h"
#include "torch/torch.h"

namespace invgrad {

struct FactoredLayers {
  std::vector<LayerColumns> columns;  // in the order of the layers' weights
  // Memory of Factors: for each sample, and of the patches at a time.
  double bytes_per_column = 0.0;
  double bytes_of_patches = 0.0;
};

// The layers in the graph of `output`, which has a sample for each entry of its
// first dimension.
FactoredLayers FindFactoredLayers(const torch::Tensor& output,
                                  const std::vector<torch::Tensor>& parameters);

// The factors for covectors of the output, of its shape. Keeps the graph.
SampledFactors TorchFactors(const torch::Tensor& output,
                            const torch::Tensor& covectors,
                            const std::vector<torch::Tensor>& parameters);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_FACTORS_H_
