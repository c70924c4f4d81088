#include "invgrad/torch/torch_factors.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <unordered_map>
#include <utility>

#include "invgrad/torch/torch_tensors.h"
#include "torch/csrc/autograd/engine.h"
#include "torch/csrc/autograd/generated/Functions.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using torch::Tensor;
using torch::autograd::Edge;
using torch::autograd::Node;
namespace graph = torch::autograd::generated;

// Patches and their squares are formed for as many samples at a time as fit into
// this.
constexpr int64_t kPatchBytes = 8 << 20;

constexpr int kNone = -1;

// A layer and its calls in the graph. Parameters are numbers.
struct Layer {
  int weight = kNone;
  int bias = kNone;
  std::vector<std::shared_ptr<Node>> calls;
};

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
  explicit LayerSearch(const std::vector<Tensor>& parameters) {
    for (size_t i = 0; i < parameters.size(); ++i) {
      numbers_[torch::autograd::impl::gradient_edge(parameters[i])
                   .function.get()] = static_cast<int>(i);
    }
  }

  std::vector<Layer> Run(const Tensor& output) {
    std::vector<std::shared_ptr<Node>> stack = {output.grad_fn()};
    std::set<const Node*> visited;
    while (!stack.empty()) {
      const std::shared_ptr<Node> node = stack.back();
      stack.pop_back();
      if (node == nullptr || !visited.insert(node.get()).second) continue;
      Visit(node);
      for (const Edge& edge : node->next_edges())
        stack.push_back(edge.function);
    }
    std::vector<Layer> layers;
    for (auto& [weight, layer] : layers_) layers.push_back(std::move(layer));
    return layers;
  }

 private:
  int NumberAt(const Edge& edge) const {
    const auto found = numbers_.find(edge.function.get());
    return found == numbers_.end() ? kNone : found->second;
  }
  // Of a transposed parameter.
  int TransposedAt(const Edge& edge) const {
    const auto* t = dynamic_cast<const graph::TBackward0*>(edge.function.get());
    return t == nullptr ? kNone : NumberAt(t->next_edge(0));
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
      Add(node, TransposedAt(node->next_edge(1)), kNone);
    }
  }

  // The first call of a layer decides on its bias, which belongs to no other.
  void Add(const std::shared_ptr<Node>& node, int weight, int bias) {
    if (weight == kNone) return;
    Layer& layer = layers_[weight];
    if (layer.calls.empty()) {
      layer.weight = weight;
      if (bias != kNone && biases_.insert(bias).second) layer.bias = bias;
    }
    layer.calls.push_back(node);
  }

  std::unordered_map<const Node*, int> numbers_;  // of the parameters' nodes
  std::map<int, Layer> layers_;
  std::set<int> biases_;
};

// The inputs of a call: (samples, channels, rows, cols) of a convolution,
// (positions, fan_in) of a linear layer.
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

// The a_t of some inputs of a call: (samples, fan_in, positions).
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

// Of the patches of a sample, and their squares.
int64_t BytesOfSample(const Node& call,
                      const Tensor& weight,
                      const Tensor& inputs) {
  const Tensor patches = PatchesOf(call, weight, inputs.narrow(0, 0, 1));
  return patches.element_size() * patches.size(1) *
         (patches.size(1) + patches.size(2));
}

// The covectors of the outputs of a call: (samples, fan_out, positions).
Tensor DeltasOf(const Tensor& covectors) {
  return covectors.dim() == 2 ? covectors.t().unsqueeze(0)
                              : covectors.flatten(2);
}

// *sum += the squares x x^T of the columns of each sample.
void AddSquares(const Tensor& columns, Eigen::Ref<MatrixXd> sum) {
  sum += ToColumns(at::bmm(columns, columns.transpose(1, 2)).sum(0));
}

// Adds the squares of (a_t, 1), and returns the number of positions.
int64_t AddInputs(const Node& call, const Tensor& weight, MatrixXd* A) {
  const Tensor inputs = InputsOf(call);
  const int64_t fan_in = weight.numel() / weight.size(0);
  int64_t chunk = inputs.size(0);
  if (inputs.dim() == 4) {
    chunk = std::clamp<int64_t>(
        kPatchBytes / BytesOfSample(call, weight, inputs), 1, chunk);
  }
  int64_t num_positions = 0;
  for (int64_t first = 0; first < inputs.size(0); first += chunk) {
    const int64_t size = std::min(chunk, inputs.size(0) - first);
    const Tensor patches =
        PatchesOf(call, weight, inputs.narrow(0, first, size));
    AddSquares(patches, A->topLeftCorner(fan_in, fan_in));
    num_positions += patches.size(0) * patches.size(2);
    if (A->cols() == fan_in) continue;
    A->col(fan_in).head(fan_in) += Flatten({patches.sum(at::IntArrayRef({0, 2}),
                                                        /*keepdim=*/false,
                                                        torch::kDouble)});
  }
  if (A->cols() > fan_in) {
    A->row(fan_in).head(fan_in) = A->col(fan_in).head(fan_in).transpose();
    (*A)(fan_in, fan_in) += static_cast<double>(num_positions);
  }
  return num_positions;
}

// The first weight of each parameter, and the number of all weights.
std::vector<int> FirstColumns(const std::vector<Tensor>& parameters) {
  std::vector<int> columns = {0};
  for (const Tensor& parameter : parameters) {
    columns.push_back(columns.back() + static_cast<int>(parameter.numel()));
  }
  return columns;
}

LayerColumns ColumnsOf(const Layer& layer,
                       const std::vector<Tensor>& parameters) {
  const std::vector<int> first = FirstColumns(parameters);
  const Tensor& weight = parameters[layer.weight];
  const int fan_out = static_cast<int>(weight.size(0));
  const int num_inputs = static_cast<int>(weight.numel()) / fan_out;
  LayerColumns columns(num_inputs + (layer.bias == kNone ? 0 : 1), fan_out);
  for (int unit = 0; unit < fan_out; ++unit) {
    for (int i = 0; i < num_inputs; ++i) {
      columns(i, unit) = first[layer.weight] + unit * num_inputs + i;
    }
    if (layer.bias == kNone) continue;
    columns(num_inputs, unit) = first[layer.bias] + unit;
  }
  return columns;
}

}  // namespace

TorchLayers FindTorchLayers(const Tensor& output,
                            const std::vector<Tensor>& parameters) {
  TorchLayers result;
  result.bytes_of_patches = kPatchBytes;
  for (const Layer& layer : LayerSearch(parameters).Run(output)) {
    result.columns.push_back(ColumnsOf(layer, parameters));
    const LayerColumns& columns = result.columns.back();
    const Tensor& weight = parameters[layer.weight];
    for (const auto& call : layer.calls) {
      const Tensor inputs = InputsOf(*call);
      const int64_t num_positions =
          inputs.dim() == 4
              ? PatchesOf(*call, weight, inputs.narrow(0, 0, 1)).size(2)
              : inputs.size(0) / output.size(0);
      const auto bytes =
          static_cast<double>(num_positions * weight.element_size());
      result.bytes_per_column += bytes * columns.cols();
      result.bytes_of_patches =
          std::max(result.bytes_of_patches,
                   static_cast<double>(BytesOfSample(*call, weight, inputs)));
    }
  }
  return result;
}

SampledFactors TorchFactors(const Tensor& output,
                            const Tensor& covectors,
                            const std::vector<Tensor>& parameters) {
  const std::vector<Layer> layers = LayerSearch(parameters).Run(output);
  std::set<int> others;
  for (size_t i = 0; i < parameters.size(); ++i) others.insert(i);
  torch::autograd::edge_list edges;
  for (const Layer& layer : layers) {
    for (const auto& call : layer.calls) edges.emplace_back(call, 0);
    others.erase(layer.weight);
    others.erase(layer.bias);
  }
  for (const int i : others) {
    edges.push_back(torch::autograd::impl::gradient_edge(parameters[i]));
  }
  // The derivatives at all edges in one backward pass.
  const torch::autograd::variable_list derivatives =
      torch::autograd::Engine::get_default_engine().execute(
          {torch::autograd::impl::gradient_edge(output)},
          {covectors},
          /*keep_graph=*/true,
          /*create_graph=*/false,
          /*accumulate_grad=*/false,
          edges);

  const torch::NoGradGuard guard;
  SampledFactors factors;
  auto next = derivatives.begin();
  for (const Layer& layer : layers) {
    const LayerColumns columns = ColumnsOf(layer, parameters);
    SampledFactors::Layer& of_layer = factors.layers.emplace_back();
    of_layer.A.setZero(columns.rows(), columns.rows());
    of_layer.D.setZero(columns.cols(), columns.cols());
    int64_t num_positions = 0;
    for (const auto& call : layer.calls) {
      num_positions += AddInputs(*call, parameters[layer.weight], &of_layer.A);
      // Undefined where the output does not depend on the call.
      if (next->defined()) AddSquares(DeltasOf(*next), of_layer.D);
      ++next;
    }
    of_layer.A /= static_cast<double>(num_positions);
  }
  const std::vector<int> first = FirstColumns(parameters);
  factors.others.setZero(first.back());
  for (const int i : others) {
    if (next->defined()) {
      factors.others.segment(first[i], next->numel()) = Flatten({*next});
    }
    ++next;
  }
  return factors;
}

}  // namespace invgrad
