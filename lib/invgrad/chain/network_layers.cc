#include "invgrad/internal/network_layers.h"

#include <memory>

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

bool HasInputJacobian(const Network& network) {
  return dynamic_cast<const InputDifferentiableNetwork*>(&network) != nullptr;
}

bool InputJacobianOf(const Network& network,
                     const Eigen::VectorXd& weights,
                     const Eigen::VectorXd& input,
                     Eigen::VectorXd* outputs,
                     Eigen::MatrixXd* jacobian,
                     std::string* error) {
  if (jacobian == nullptr) {
    const std::unique_ptr<Network::Pass> pass = network.NewPass();
    if (!network.Forward(
            weights, input, Network::Derivatives::kNone, pass.get(), error)) {
      return false;
    }
    *outputs = pass->outputs.col(0);
    return true;
  }
  const auto* differentiable =
      dynamic_cast<const InputDifferentiableNetwork*>(&network);
  CHECK(differentiable != nullptr)
      << "the network has no derivatives with respect to its input";
  return differentiable->InputJacobian(
      weights, input, outputs, jacobian, error);
}

}  // namespace invgrad
