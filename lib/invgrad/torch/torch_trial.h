// A forward pass that finds out whether a function can be a network.
#ifndef INVGRAD_TORCH_TORCH_TRIAL_H_
#define INVGRAD_TORCH_TORCH_TRIAL_H_

#include <cstdint>
#include <string>
#include <vector>

#include "invgrad/torch_network.h"

namespace invgrad {

// "(2, 64, 64)"
std::string ShapeText(const std::vector<int64_t>& shape);

// Finds the shape of a sample's output. Returns false, with *error, if the
// function throws, changes a buffer, is random, or returns a tensor of another
// batch size or type, or one that does not depend on the parameters.
bool TryForward(const TorchFunction& function,
                const torch::Tensor& input,
                std::vector<int64_t>* output_shape,
                std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_TRIAL_H_
