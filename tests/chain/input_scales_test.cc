#include <cmath>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace input_scales_test {

TEST(InputScales, UnscaledWeightsDoOnInputsWhatWeightsDoOnScaledOnes) {
  const DenseNetwork network({3, 4, 2}, Activation::kTanh);
  Eigen::MatrixXd inputs = RandomMatrix(3, 50, 1);
  inputs.row(0) *= 1e4;
  inputs.row(1).array() += 300.0;
  inputs.row(2).setConstant(7.0);
  const InputScales scales = InputScales::Of(inputs);
  const Eigen::MatrixXd scaled = scales.Apply(inputs);
  EXPECT_LE(scaled.rowwise().mean().norm(), 1e-12);
  EXPECT_NEAR(scaled.row(0).squaredNorm(), 50.0, 1e-9);
  EXPECT_NEAR(scaled.row(1).squaredNorm(), 50.0, 1e-9);
  EXPECT_EQ(scales.deviation[2], 1.0);
  const Eigen::VectorXd weights = RandomMatrix(network.num_weights(), 1, 2);
  const Eigen::VectorXd unscaled = scales.Unscaled(network, weights);
  DenseNetwork::Activations activations;
  network.Forward(weights, scaled, false, &activations);
  const Eigen::MatrixXd expected = activations.outputs;
  network.Forward(unscaled, inputs, false, &activations);
  EXPECT_LE((activations.outputs - expected).norm(), 1e-10);
}

// Their mean has a rounding error.
TEST(InputScales, ConstantsHaveTheDeviationOne) {
  const DenseNetwork network({2, 8, 1}, Activation::kTanh);
  const Eigen::VectorXd weights = RandomMatrix(network.num_weights(), 1, 3);
  for (const int num_samples : {10, 100, 256}) {
    for (const double constant : {0.1, 9.81, -0.3, 1e-3, 0.0}) {
      Eigen::MatrixXd inputs = RandomMatrix(2, num_samples, 1);
      inputs.row(1).setConstant(constant);
      const InputScales scales = InputScales::Of(inputs);
      EXPECT_EQ(scales.deviation[1], 1.0) << num_samples << " " << constant;
      EXPECT_NE(scales.deviation[0], 1.0);
      DenseNetwork::Activations activations;
      network.Forward(weights, scales.Apply(inputs), false, &activations);
      const Eigen::MatrixXd expected = activations.outputs;
      network.Forward(
          scales.Unscaled(network, weights), inputs, false, &activations);
      EXPECT_LE((activations.outputs - expected).norm(), 1e-11);
    }
  }
}

}  // namespace input_scales_test
}  // namespace invgrad
