// Statistics of a network's hidden neurons over a data set.
//
//   mean = E[a],  deviation = sqrt(E[(a - mean)^2]),
//   flat_share = P(|phi'(z)| < 0.1)
//
// over the samples, a = phi(z) the neuron's activation. A neuron that is flat
// for nearly all samples (|tanh| > 0.95, a dead ReLU) is saturated: it no
// longer learns (Schnell, Holl, Thuerey, ICLR 2022, section 3.1).
#ifndef INVGRAD_CHAIN_NEURON_STATISTICS_H_
#define INVGRAD_CHAIN_NEURON_STATISTICS_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/dense_network.h"

namespace invgrad {

struct NeuronStatistics {
  int layer = 0;   // 1 .. L - 1
  int neuron = 0;  // 0 .. width - 1
  double mean = 0.0;
  double deviation = 0.0;
  double flat_share = 0.0;

  bool is_saturated() const { return flat_share >= 0.9; }
};

// One entry a hidden neuron, layer by layer; none for a network that is not a
// DenseNetwork.
std::vector<NeuronStatistics> ComputeNeuronStatistics(
    const Network& network,
    const Eigen::VectorXd& weights,
    const DataSet& data);

int CountSaturated(const std::vector<NeuronStatistics>& neurons);

// The mean and the deviation over all neurons and samples, each neuron with the
// sign that makes its mean positive: as tanh is odd, the sign of a neuron is
// arbitrary. All neurons saturated: mean 1, deviation 0. At least one neuron.
struct PooledActivation {
  double mean = 0.0;
  double deviation = 0.0;
};
PooledActivation PoolActivations(const std::vector<NeuronStatistics>& neurons);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_NEURON_STATISTICS_H_
