#include "invgrad/torch/torch_layers.h"

#include <map>
#include <set>
#include <unordered_map>
#include <utility>

#include "torch/csrc/autograd/generated/Functions.h"

namespace invgrad {
namespace {

using torch::Tensor;
using torch::autograd::Edge;
using torch::autograd::Node;
namespace graph = torch::autograd::generated;

// Integers are int64_t or, in later versions of libtorch, c10::SymInt.
template <typename Integers>
std::vector<int64_t> ToIntegers(const Integers& values) {
  std::vector<int64_t> integers;
  integers.reserve(values.size());
  for (const auto& value : values) {
    integers.push_back(c10::SymInt(value).expect_int());
  }
  return integers;
}

// Walks the graph of an output.
class LayerSearch {
 public:
  explicit LayerSearch(const std::vector<Tensor>& parameters)
      : parameters_(parameters) {
    for (size_t i = 0; i < parameters.size(); ++i) {
      numbers_[torch::autograd::impl::gradient_edge(parameters[i])
                   .function.get()] = static_cast<int>(i);
    }
  }

  std::vector<TorchLayer> Run(const Tensor& output) {
    for (const auto& node : NodesBehind({output.grad_fn()})) Visit(node);
    std::vector<TorchLayer> layers;
    for (auto& [weight, layer] : layers_) layers.push_back(std::move(layer));
    return layers;
  }

 private:
  int NumberAt(const Edge& edge) const {
    const auto found = numbers_.find(edge.function.get());
    return found == numbers_.end() ? kNoParameter : found->second;
  }
  // Of a transposed parameter.
  int TransposedAt(const Edge& edge) const {
    const auto* t = dynamic_cast<const graph::TBackward0*>(edge.function.get());
    return t == nullptr ? kNoParameter : NumberAt(t->next_edge(0));
  }

  void Visit(const std::shared_ptr<Node>& node) {
    if (const auto* convolution =
            dynamic_cast<const graph::ConvolutionBackward0*>(node.get())) {
      if (convolution->transposed || convolution->groups != 1 ||
          convolution->stride.size() != 2) {
        return;
      }
      Add(node, NumberAt(node->next_edge(1)), NumberAt(node->next_edge(2)));
    } else if (const auto* addmm =
                   dynamic_cast<const graph::AddmmBackward0*>(node.get())) {
      if (!addmm->alpha.equal(1) || !addmm->beta.equal(1)) return;
      Add(node, TransposedAt(node->next_edge(2)), NumberAt(node->next_edge(0)));
    } else if (dynamic_cast<const graph::MmBackward0*>(node.get()) != nullptr) {
      Add(node, TransposedAt(node->next_edge(1)), kNoParameter);
    }
  }

  // The first call of a layer decides on its bias, which has a number for each
  // output and belongs to no other layer.
  void Add(const std::shared_ptr<Node>& node, int weight, int bias) {
    if (weight == kNoParameter) return;
    TorchLayer& layer = layers_[weight];
    if (layer.calls.empty()) {
      layer.weight = weight;
      if (bias != kNoParameter &&
          parameters_[bias].sizes() ==
              parameters_[weight].sizes().slice(0, 1) &&
          biases_.insert(bias).second) {
        layer.bias = bias;
      }
    }
    layer.calls.push_back(node);
  }

  const std::vector<Tensor>& parameters_;
  std::unordered_map<const Node*, int> numbers_;  // of the parameters' nodes
  std::map<int, TorchLayer> layers_;
  std::set<int> biases_;
};

}  // namespace

std::vector<TorchLayer> FindLayers(const Tensor& output,
                                   const std::vector<Tensor>& parameters) {
  return LayerSearch(parameters).Run(output);
}

TorchNodes NodesBehind(TorchNodes nodes) {
  TorchNodes found;
  std::set<const Node*> visited;
  while (!nodes.empty()) {
    const std::shared_ptr<Node> node = nodes.back();
    nodes.pop_back();
    if (node == nullptr || !visited.insert(node.get()).second) continue;
    found.push_back(node);
    for (const Edge& edge : node->next_edges()) nodes.push_back(edge.function);
  }
  return found;
}

Tensor InputsOf(const Node& call) {
  const torch::NoGradGuard guard;
  if (const auto* convolution =
          dynamic_cast<const graph::ConvolutionBackward0*>(&call)) {
    return convolution->input_.unpack().detach();
  }
  if (const auto* addmm = dynamic_cast<const graph::AddmmBackward0*>(&call)) {
    return addmm->mat1_.unpack().detach();
  }
  return dynamic_cast<const graph::MmBackward0&>(call).self_.unpack().detach();
}

Tensor PatchesOf(const Node& call, const Tensor& weight, const Tensor& inputs) {
  if (const auto* convolution =
          dynamic_cast<const graph::ConvolutionBackward0*>(&call)) {
    return at::im2col(inputs,
                      weight.sizes().slice(2),
                      ToIntegers(convolution->dilation),
                      ToIntegers(convolution->padding),
                      ToIntegers(convolution->stride));
  }
  return inputs.t().unsqueeze(0);
}

std::vector<int> FirstColumns(const std::vector<Tensor>& parameters) {
  std::vector<int> columns = {0};
  for (const Tensor& parameter : parameters) {
    columns.push_back(columns.back() + static_cast<int>(parameter.numel()));
  }
  return columns;
}

LayerColumns ColumnsOf(const TorchLayer& layer,
                       const std::vector<Tensor>& parameters) {
  const std::vector<int> first = FirstColumns(parameters);
  const Tensor& weight = parameters[layer.weight];
  const int fan_out = static_cast<int>(weight.size(0));
  const int num_inputs = static_cast<int>(weight.numel()) / fan_out;
  LayerColumns columns(num_inputs + (layer.bias == kNoParameter ? 0 : 1),
                       fan_out);
  for (int unit = 0; unit < fan_out; ++unit) {
    for (int i = 0; i < num_inputs; ++i) {
      columns(i, unit) = first[layer.weight] + unit * num_inputs + i;
    }
    if (layer.bias == kNoParameter) continue;
    columns(num_inputs, unit) = first[layer.bias] + unit;
  }
  return columns;
}

}  // namespace invgrad
