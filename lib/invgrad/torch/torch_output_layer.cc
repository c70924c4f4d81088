#include "invgrad/torch/torch_output_layer.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "invgrad/torch/torch_layers.h"
#include "invgrad/torch/torch_tensors.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using torch::Tensor;
using torch::autograd::Edge;
using torch::autograd::Node;

// Whether the result has the entries of the input in the same order.
bool KeepsOrder(const Node& node) {
  static const std::set<std::string>* const names = new std::set<std::string>{
      "AliasBackward0",
      "CloneBackward0",
      "ReshapeAliasBackward0",
      "SqueezeBackward0",
      "SqueezeBackward1",
      "UnsafeViewBackward0",
      "UnsqueezeBackward0",
      "ViewBackward0",
  };
  return names->count(node.name()) > 0;
}

std::shared_ptr<Node> LastCall(const Tensor& output) {
  std::shared_ptr<Node> node = output.grad_fn();
  while (node != nullptr && KeepsOrder(*node)) {
    node = node->next_edge(0).function;
  }
  return node;
}

// The number of arguments of a call that depend on a parameter.
long NumArguments(const Node& call, const Tensor& parameter) {
  const Edge of_parameter = torch::autograd::impl::gradient_edge(parameter);
  const auto& arguments = call.next_edges();
  return std::count_if(
      arguments.begin(), arguments.end(), [&](const Edge& argument) {
        const TorchNodes nodes = NodesBehind({argument.function});
        return std::count(nodes.begin(), nodes.end(), of_parameter.function) >
               0;
      });
}

std::optional<TorchLayer> LastLayer(const Tensor& output,
                                    const std::vector<Tensor>& parameters) {
  const std::shared_ptr<Node> call = LastCall(output);
  for (const TorchLayer& layer : FindLayers(output, parameters)) {
    if (layer.calls.front() != call) continue;
    const Tensor& weight = parameters[layer.weight];
    const bool is_used_again =
        NumArguments(*call, weight) > 1 ||
        (layer.bias != kNoParameter &&
         NumArguments(*call, parameters[layer.bias]) > 1);
    const bool has_blocks =
        weight.size(0) == 1 || InputsOf(*call).size(0) == output.size(0);
    if (!is_used_again && has_blocks) return layer;
  }
  return std::nullopt;
}

}  // namespace

LayerColumns TorchOutputLayer(const Tensor& output,
                              const std::vector<Tensor>& parameters) {
  const auto layer = LastLayer(output, parameters);
  return layer.has_value() ? ColumnsOf(*layer, parameters) : LayerColumns();
}

MatrixXd TorchFeatures(const Tensor& output,
                       const std::vector<Tensor>& parameters) {
  const auto layer = LastLayer(output, parameters);
  TORCH_CHECK(layer.has_value(), "the module has lost its output layer");
  const torch::NoGradGuard guard;
  const Node& call = *layer->calls.front();
  const Tensor patches =
      PatchesOf(call, parameters[layer->weight], InputsOf(call));
  MatrixXd h =
      ToColumns(patches.transpose(1, 2).reshape({-1, patches.size(1)}));
  if (layer->bias == kNoParameter) return h;
  h.conservativeResize(h.rows() + 1, Eigen::NoChange);
  h.bottomRows(1).setOnes();
  return h;
}

}  // namespace invgrad
