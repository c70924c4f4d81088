// What some networks also are: interfaces that a Network may also implement, for
// exact output layers, for K-FAC, and for derivatives by the input.
//
// Callers use the free functions below, which work with any network. A class
// whose networks may or may not have such layers, as that of libtorch,
// implements the interfaces and returns nothing.
#ifndef INVGRAD_INTERNAL_NETWORK_LAYERS_H_
#define INVGRAD_INTERNAL_NETWORK_LAYERS_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/sampled_factors.h"
#include "invgrad/network.h"

namespace invgrad {

// A network whose outputs are affine in the weights C of its last layer: at
// each position p of a column, such as a cell of an image,
//
//   x_p = C^T h_p + what does not depend on C
//
// h: the features, with a last 1 if the layer has biases.
class LinearOutputNetwork {
 public:
  virtual ~LinearOutputNetwork() = default;

  // fan_in x fan_out: the number of the weight of each entry of C. Empty: there
  // is no such layer. The outputs of a column are fan_out blocks with an entry
  // for each position.
  virtual LayerColumns OutputLayer() const = 0;
  // h: fan_in x positions of all columns, those of a column side by side, of a
  // pass with derivatives.
  virtual Eigen::MatrixXd Features(const Eigen::VectorXd& weights,
                                   const Network::Pass& pass) const = 0;
};

// A network that gives the Kronecker factors of its layers (sampled_factors.h).
class FactoredNetwork {
 public:
  virtual ~FactoredNetwork() = default;

  // The layers of Factors; may be empty.
  virtual std::vector<LayerColumns> FactorLayers() const = 0;
  // For output covectors w: num_outputs x columns. NaN if it fails.
  virtual void Factors(const Eigen::VectorXd& weights,
                       const Network::Pass& pass,
                       const Eigen::MatrixXd& output_covectors,
                       SampledFactors* factors) const = 0;
};

// A network with derivatives with respect to its input.
class InputDifferentiableNetwork {
 public:
  virtual ~InputDifferentiableNetwork() = default;

  // x and dx/da (|x| x |a|) of one sample. Returns false, with *error, as
  // Network::Forward.
  virtual bool InputJacobian(const Eigen::VectorXd& weights,
                             const Eigen::VectorXd& input,
                             Eigen::VectorXd* outputs,
                             Eigen::MatrixXd* jacobian,
                             std::string* error) const = 0;
};

// The output layer of the network, or an empty one.
LayerColumns OutputLayerOf(const Network& network);
// Only with an output layer.
Eigen::MatrixXd FeaturesOf(const Network& network,
                           const Eigen::VectorXd& weights,
                           const Network::Pass& pass);

// The layers whose factors FactorsOf gives, or none.
std::vector<LayerColumns> FactorLayersOf(const Network& network);
// Only with such layers.
void FactorsOf(const Network& network,
               const Eigen::VectorXd& weights,
               const Network::Pass& pass,
               const Eigen::MatrixXd& output_covectors,
               SampledFactors* factors);

// Whether the network is an InputDifferentiableNetwork.
bool HasInputJacobian(const Network& network);
// Only for such networks, unless `jacobian` is null.
bool InputJacobianOf(const Network& network,
                     const Eigen::VectorXd& weights,
                     const Eigen::VectorXd& input,
                     Eigen::VectorXd* outputs,
                     Eigen::MatrixXd* jacobian,
                     std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_NETWORK_LAYERS_H_
