// Networks for tests of the rules that treat a network layer by layer.
#ifndef INVGRAD_TESTS_RULES_LAYERS_H_
#define INVGRAD_TESTS_RULES_LAYERS_H_

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "tests/support/random_matrix.h"

namespace invgrad {

// Layers with fewer and with more weights than J has rows: 12, 20 and 15
// against 16.
inline const std::vector<int> kWidths = {2, 4, 4, 3};
inline constexpr int kBatchSize = 8;
inline constexpr int kOutputs = 2;

// A network at random weights in front of simulators with the given Jacobians.
inline Linearization AtNetwork(const std::vector<int>& widths,
                               const Eigen::MatrixXd& inputs,
                               Eigen::MatrixXd simulator_jacobians,
                               Eigen::VectorXd g) {
  const DenseNetwork network(widths, Activation::kTanh);
  const Eigen::VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
  DenseNetwork::Activations activations;
  network.Forward(weights, inputs, false, &activations);
  Linearization at_x;
  at_x.loss_gradient = std::move(g);
  at_x.jacobian = std::make_shared<NetworkJacobian>(
      network, weights, activations, std::move(simulator_jacobians));
  return at_x;
}

inline Linearization AtNetwork(const std::vector<int>& widths,
                               int batch_size,
                               int outputs_per_sample) {
  const int m = batch_size * outputs_per_sample;
  return AtNetwork(widths,
                   RandomMatrix(widths.front(), batch_size, 2),
                   RandomMatrix(widths.back(), m, 3),
                   RandomMatrix(m, 1, 4));
}

inline std::string ErrorOf(const std::string& text, const Linearization& at_x) {
  Eigen::VectorXd step;
  std::string error;
  EXPECT_FALSE(MakeRule(text)->ComputeStep(at_x, &step, &error));
  return error;
}

inline void ExpectNear(const Eigen::VectorXd& actual,
                       const Eigen::VectorXd& expected,
                       double tolerance) {
  ASSERT_EQ(actual.size(), expected.size());
  EXPECT_LE((actual - expected).norm(), tolerance * expected.norm());
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_RULES_LAYERS_H_
