// The last layer of a graph of libtorch, if the output is affine in its weights
// (chain/network.h, OutputLayer).
//
//   x_p = W h_p + b   at each position p of a sample
//
// It is a layer (torch_layers.h) that only views follow, and whose parameters
// the module uses nowhere else. b belongs to it if it is a parameter; otherwise
// it is what does not depend on C = W^T. For convolutions, h_p is the patch
// under the kernel.
//
// Shapes:  output: (B, ..). A linear layer of several outputs has one position
//          a sample: the outputs of several would lie side by side, and not in
//          blocks.
// Cost:    a walk over the graph, and for the features a copy.
// Fails:   TorchFeatures throws if there is no such layer. A weight that the
//          module also uses without its graph (detach) is not seen.
#ifndef INVGRAD_TORCH_TORCH_OUTPUT_LAYER_H_
#define INVGRAD_TORCH_TORCH_OUTPUT_LAYER_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/sampled_factors.h"
#include "torch/torch.h"

namespace invgrad {

// Empty if there is none.
LayerColumns TorchOutputLayer(const torch::Tensor& output,
                              const std::vector<torch::Tensor>& parameters);

// h, with a last 1 if b belongs to the layer: fan_in x positions of all
// samples.
Eigen::MatrixXd TorchFeatures(const torch::Tensor& output,
                              const std::vector<torch::Tensor>& parameters);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_OUTPUT_LAYER_H_
