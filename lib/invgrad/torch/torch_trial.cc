#include "invgrad/torch/torch_trial.h"

#include <exception>

#include "invgrad/torch/torch_message.h"

namespace invgrad {

using torch::Tensor;

std::string ShapeText(const std::vector<int64_t>& shape) {
  std::string text;
  for (const int64_t size : shape) {
    text += (text.empty() ? "" : ", ") + std::to_string(size);
  }
  return '(' + text + ')';
}

bool TryForward(const TorchFunction& function,
                const Tensor& input,
                std::vector<int64_t>* output_shape,
                std::string* error) {
  const std::string takes =
      "an input of the shape " + ShapeText(input.sizes().vec());
  std::vector<Tensor> before;
  for (const auto& [name, buffer] : function.buffers) {
    before.push_back(buffer.clone());
  }
  const torch::AutoGradMode mode(true);
  Tensor output, again;
  try {
    output = function.forward(input);
    again = function.forward(input);
  } catch (const std::exception& exception) {
    *error =
        "the module does not take " + takes + ": " + TorchMessage(exception);
    return false;
  }
  for (size_t i = 0; i < before.size(); ++i) {
    const auto& [name, buffer] = function.buffers[i];
    if (torch::equal(before[i], buffer)) continue;
    *error = "a forward pass changes the buffer " + name +
             ": call eval() before the export, or use batch normalization "
             "without track_running_stats";
    return false;
  }
  if (output.dim() < 1 || output.size(0) != input.size(0)) {
    *error = "for " + takes +
             " the module must return a tensor of the shape (" +
             std::to_string(input.size(0)) + ", ...), found " +
             ShapeText(output.sizes().vec());
    return false;
  }
  if (output.scalar_type() != input.scalar_type()) {
    *error = std::string("the module must return values of the type ") +
             torch::toString(input.scalar_type()) + ", found " +
             torch::toString(output.scalar_type());
    return false;
  }
  if (!torch::allclose(
          output, again, /*rtol=*/1e-4, /*atol=*/0.0, /*equal_nan=*/true)) {
    *error =
        "two forward passes with the same weights differ: call eval(), which "
        "switches dropout off";
    return false;
  }
  if (!output.requires_grad()) {
    *error = "the output does not depend on the parameters differentiably";
    return false;
  }
  output_shape->assign(output.sizes().begin() + 1, output.sizes().end());
  return true;
}

}  // namespace invgrad
