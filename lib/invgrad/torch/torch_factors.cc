#include "invgrad/torch/torch_factors.h"

#include <algorithm>
#include <set>

#include "invgrad/torch/torch_layers.h"
#include "invgrad/torch/torch_tensors.h"
#include "torch/csrc/autograd/engine.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using torch::Tensor;
using torch::autograd::Node;

// Patches and their squares are formed for as many samples at a time as fit into
// this.
constexpr int64_t kPatchBytes = 8 << 20;

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

}  // namespace

std::vector<LayerColumns> FactorLayerColumns(
    const Tensor& output, const std::vector<Tensor>& parameters) {
  std::vector<LayerColumns> columns;
  for (const TorchLayer& layer : FindLayers(output, parameters)) {
    columns.push_back(ColumnsOf(layer, parameters));
  }
  return columns;
}

SampledFactors TorchFactors(const Tensor& output,
                            const Tensor& covectors,
                            const std::vector<Tensor>& parameters) {
  const std::vector<TorchLayer> layers = FindLayers(output, parameters);
  std::set<int> others;
  for (size_t i = 0; i < parameters.size(); ++i) others.insert(i);
  torch::autograd::edge_list edges;
  for (const TorchLayer& layer : layers) {
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
  for (const TorchLayer& layer : layers) {
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
