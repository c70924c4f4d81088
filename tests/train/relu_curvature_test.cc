// What the Hessian of a loss contains of a network's own curvature,
//
//   H = J^T H_L J + K,   K = sum_i w_i d2f_i/dtheta2,   w = dL/df
//
// with ReLU and with tanh.

#include <vector>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace relu_curvature_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kNumSamples = 12;

struct Curvature {
  DenseNetwork network;
  MatrixXd K;

  Curvature(const std::vector<int>& widths, Activation hidden)
      : network(widths, hidden) {
    const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
    DenseNetwork::Activations activations;
    network.Forward(
        weights, RandomMatrix(widths[0], kNumSamples, 2), true, &activations);
    const int num_outputs = network.num_outputs();
    network.Hessian(weights,
                    activations,
                    RandomMatrix(num_outputs, kNumSamples, 3),
                    std::vector<MatrixXd>(
                        kNumSamples, MatrixXd::Zero(num_outputs, num_outputs)),
                    &K);
  }

  double LayerNorm(int layer) const {
    return K
        .block(network.offset(layer),
               network.offset(layer),
               network.layer_size(layer),
               network.layer_size(layer))
        .norm();
  }
};

// f is linear in the weights of one layer: K has no diagonal, and Newton's
// method on one layer is Gauss-Newton.
TEST(ReluCurvature, IsZeroWithinALayerButNotBetweenLayers) {
  const Curvature relu({3, 6, 5, 2}, Activation::kRelu);
  const Curvature tanh({3, 6, 5, 2}, Activation::kTanh);
  for (int l = 0; l < 3; ++l) EXPECT_EQ(relu.LayerNorm(l), 0.0) << l;
  EXPECT_GT(relu.K.norm(), 1.0);
  for (int l = 0; l < 2; ++l) {
    EXPECT_GT(tanh.LayerNorm(l), 0.1 * tanh.K.norm()) << l;
  }
  EXPECT_EQ(tanh.LayerNorm(2), 0.0);  // linear
}

// With two layers the eigenvalues of K are pairs of both signs: what Newton's
// method gets of the network points up as much as down.
TEST(ReluCurvature, IsIndefinite) {
  const Curvature relu({3, 6, 2}, Activation::kRelu);
  const VectorXd values =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(relu.K).eigenvalues();
  EXPECT_LT((values + values.reverse()).norm(), 1e-13 * values.norm());
  EXPECT_GT(values.maxCoeff(), 1.0);
  const Curvature tanh({3, 6, 2}, Activation::kTanh);
  const VectorXd others =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(tanh.K).eigenvalues();
  EXPECT_GT((others + others.reverse()).norm(), 0.1 * others.norm());
}

// As a function of its input, as part of another problem, f has no curvature at
// all.
TEST(ReluCurvature, IsZeroInTheInput) {
  const auto change_of_slope = [](Activation hidden) {
    const DenseNetwork network({2, 8, 8, 1}, hidden);
    const VectorXd weights = RandomMatrix(network.num_weights(), 1, 4);
    const auto slope = [&](double shift) {
      DenseNetwork::Activations activations;
      const MatrixXd inputs =
          RandomMatrix(2, kNumSamples, 5).array() + shift * 1e-6;
      network.Forward(weights, inputs, false, &activations);
      MatrixXd jacobians;
      network.InputJacobians(weights, activations, &jacobians);
      return jacobians;
    };
    return (slope(1.0) - slope(-1.0)).norm() / 2e-6;
  };
  EXPECT_EQ(change_of_slope(Activation::kRelu), 0.0);
  EXPECT_GT(change_of_slope(Activation::kTanh), 0.1);
}

}  // namespace relu_curvature_test
}  // namespace invgrad
