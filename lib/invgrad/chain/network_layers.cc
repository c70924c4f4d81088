#include "invgrad/internal/network_layers.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

LayerColumns OutputLayerOf(const Network& network) {
  const auto* linear = dynamic_cast<const LinearOutputNetwork*>(&network);
  return linear == nullptr ? LayerColumns() : linear->OutputLayer();
}

Eigen::MatrixXd FeaturesOf(const Network& network,
                           const Eigen::VectorXd& weights,
                           const Network::Pass& pass) {
  const auto* linear = dynamic_cast<const LinearOutputNetwork*>(&network);
  CHECK(linear != nullptr) << "the network has no output layer";
  return linear->Features(weights, pass);
}

std::vector<LayerColumns> FactorLayersOf(const Network& network) {
  const auto* factored = dynamic_cast<const FactoredNetwork*>(&network);
  if (factored == nullptr) return {};
  return factored->FactorLayers();
}

void FactorsOf(const Network& network,
               const Eigen::VectorXd& weights,
               const Network::Pass& pass,
               const Eigen::MatrixXd& output_covectors,
               SampledFactors* factors) {
  const auto* factored = dynamic_cast<const FactoredNetwork*>(&network);
  CHECK(factored != nullptr) << "the network gives no factors of layers";
  factored->Factors(weights, pass, output_covectors, factors);
}

}  // namespace invgrad
