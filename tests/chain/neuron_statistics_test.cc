#include "invgrad/chain/neuron_statistics.h"

#include <cmath>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace neuron_statistics_test {

// 1-2-1 with the first neuron phi(w a + b) and the second phi(a).
Eigen::VectorXd Weights(double w, double b) {
  Eigen::VectorXd weights(7);
  weights << w, b, 1.0, 0.0, 1.0, 1.0, 0.0;
  return weights;
}

DataSet Inputs(const std::vector<double>& a) {
  DataSet data;
  const auto num_samples = static_cast<Eigen::Index>(a.size());
  data.inputs = Eigen::Map<const Eigen::RowVectorXd>(a.data(), num_samples);
  data.contexts.resize(0, num_samples);
  data.targets = Eigen::MatrixXd::Zero(1, num_samples);
  return data;
}

TEST(NeuronStatistics, MomentsAreThoseOfTheActivations) {
  const DenseNetwork network({1, 2, 1}, Activation::kTanh);
  const auto neurons = ComputeNeuronStatistics(
      network, Weights(2.0, 0.5), Inputs({-0.3, 0.1, 0.4}));
  ASSERT_EQ(neurons.size(), 2u);
  const double a[] = {
      std::tanh(2.0 * -0.3 + 0.5), std::tanh(0.7), std::tanh(1.3)};
  const double mean = (a[0] + a[1] + a[2]) / 3.0;
  const double variance =
      (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) / 3.0 - mean * mean;
  EXPECT_NEAR(neurons[0].mean, mean, 1e-15);
  EXPECT_NEAR(neurons[0].deviation, std::sqrt(variance), 1e-14);
  EXPECT_EQ(neurons[0].flat_share, 0.0);
  EXPECT_NEAR(neurons[1].mean,
              (std::tanh(-0.3) + std::tanh(0.1) + std::tanh(0.4)) / 3.0,
              1e-15);
}

// Directly, over the activations of both neurons, of which the first has a
// negative mean.
TEST(NeuronStatistics, PoolIsThatOfAllActivationsUpToSigns) {
  const DenseNetwork network({1, 2, 1}, Activation::kTanh);
  const double inputs[] = {-0.3, 0.1, 0.4};
  Eigen::ArrayXd a(6);
  for (int i = 0; i < 3; ++i) {
    a[i] = -std::tanh(2.0 * inputs[i] - 0.5);
    a[3 + i] = std::tanh(inputs[i]);
  }
  ASSERT_GT(a.head(3).mean(), 0.0);
  ASSERT_GT(a.tail(3).mean(), 0.0);
  const PooledActivation pooled = PoolActivations(ComputeNeuronStatistics(
      network, Weights(2.0, -0.5), Inputs({-0.3, 0.1, 0.4})));
  EXPECT_NEAR(pooled.mean, a.mean(), 1e-15);
  EXPECT_NEAR(
      pooled.deviation, std::sqrt((a - a.mean()).square().mean()), 1e-14);
}

TEST(NeuronStatistics, NeuronsAreNumberedLayerByLayer) {
  const DenseNetwork network({2, 3, 2, 1}, Activation::kTanh);
  DataSet data;
  data.inputs = Eigen::MatrixXd::Constant(2, 1, 0.1);
  const auto neurons = ComputeNeuronStatistics(
      network, Eigen::VectorXd::Zero(network.num_weights()), data);
  ASSERT_EQ(neurons.size(), 5u);
  const int layers[] = {1, 1, 1, 2, 2};
  const int numbers[] = {0, 1, 2, 0, 1};
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(neurons[i].layer, layers[i]);
    EXPECT_EQ(neurons[i].neuron, numbers[i]);
  }
}

// The slope of tanh is 1 - tanh^2: below 0.1 where |tanh| > 0.9487, z > 1.8184.
TEST(NeuronStatistics, FlatIsASlopeBelowATenth) {
  const DenseNetwork network({1, 2, 1}, Activation::kTanh);
  const auto neurons = ComputeNeuronStatistics(
      network, Weights(1.0, 0.0), Inputs({-1.82, -1.81, 1.81, 1.82}));
  EXPECT_EQ(neurons[0].flat_share, 0.5);
}

TEST(NeuronStatistics, SaturatedIsFlatForNineTenthsOfTheSamples) {
  const DenseNetwork network({1, 2, 1}, Activation::kTanh);
  std::vector<double> a(10, 5.0);
  a[0] = 0.0;
  EXPECT_EQ(CountSaturated(
                ComputeNeuronStatistics(network, Weights(1.0, 0.0), Inputs(a))),
            2);
  a[1] = 0.0;
  EXPECT_EQ(CountSaturated(
                ComputeNeuronStatistics(network, Weights(1.0, 0.0), Inputs(a))),
            0);
}

// The picture of Gauss-Newton in Schnell, Holl, Thuerey, ICLR 2022, 3.1.
TEST(NeuronStatistics, ALargeBiasSaturatesTanh) {
  const DenseNetwork network({1, 2, 1}, Activation::kTanh);
  const auto neurons = ComputeNeuronStatistics(
      network, Weights(1.0, 40.0), Inputs({-1.0, 0.0, 1.0}));
  EXPECT_EQ(neurons[0].mean, 1.0);
  EXPECT_EQ(neurons[0].deviation, 0.0);
  EXPECT_TRUE(neurons[0].is_saturated());
  EXPECT_EQ(CountSaturated(neurons), 1);
}

TEST(NeuronStatistics, ADeadReluIsSaturated) {
  const DenseNetwork network({1, 2, 1}, Activation::kRelu);
  const auto neurons =
      ComputeNeuronStatistics(network, Weights(1.0, -10.0), Inputs({0.5, 1.0}));
  EXPECT_TRUE(neurons[0].is_saturated());
  EXPECT_EQ(neurons[0].mean, 0.0);
  EXPECT_FALSE(neurons[1].is_saturated());
}

}  // namespace neuron_statistics_test
}  // namespace invgrad
