#include "invgrad/chain/neuron_statistics.h"

#include <algorithm>
#include <cmath>

#include "glog/logging.h"

namespace invgrad {

std::vector<NeuronStatistics> ComputeNeuronStatistics(
    const Network& network,
    const Eigen::VectorXd& weights,
    const DataSet& data) {
  const auto* dense = dynamic_cast<const DenseNetwork*>(&network);
  if (dense == nullptr) return {};
  DenseNetwork::Activations activations;
  // Of jets, the first rows are the values.
  dense->Forward(
      weights, data.inputs.topRows(dense->num_inputs()), false, &activations);
  const double num_samples = data.num_samples();
  std::vector<NeuronStatistics> neurons;
  for (int layer = 1; layer < dense->num_layers(); ++layer) {
    // The inputs of the next layer, whose last row is constant (one).
    const Eigen::MatrixXd& a = activations.inputs[layer];
    const Eigen::MatrixXd& slopes = activations.slopes[layer - 1];
    for (int i = 0; i < dense->widths()[layer]; ++i) {
      NeuronStatistics neuron;
      neuron.layer = layer;
      neuron.neuron = i;
      neuron.mean = a.row(i).mean();
      neuron.deviation = std::sqrt(
          (a.row(i).array() - neuron.mean).square().sum() / num_samples);
      neuron.flat_share =
          (slopes.row(i).array().abs() < 0.1).count() / num_samples;
      neurons.push_back(neuron);
    }
  }
  return neurons;
}

int CountSaturated(const std::vector<NeuronStatistics>& neurons) {
  int count = 0;
  for (const NeuronStatistics& neuron : neurons) count += neuron.is_saturated();
  return count;
}

PooledActivation PoolActivations(const std::vector<NeuronStatistics>& neurons) {
  CHECK(!neurons.empty());
  const auto count = static_cast<double>(neurons.size());
  PooledActivation pooled;
  double mean_square = 0.0;
  for (const NeuronStatistics& neuron : neurons) {
    pooled.mean += std::abs(neuron.mean) / count;
    mean_square +=
        (neuron.mean * neuron.mean + neuron.deviation * neuron.deviation) /
        count;
  }
  pooled.deviation =
      std::sqrt(std::max(0.0, mean_square - pooled.mean * pooled.mean));
  return pooled;
}

}  // namespace invgrad
