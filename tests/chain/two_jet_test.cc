#include "invgrad/chain/two_jet.h"

#include <cmath>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/dense_network.h"
#include "tests/chain/jets_by_functor.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace two_jet_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

TEST(ActivateAll, ThirdAndFourthAreTheDerivativesOfTheSecond) {
  constexpr double h = 1e-5;
  for (const Activation activation : kSmoothActivations) {
    for (const double at : {-3.0, -0.8, 0.0, 0.3, 2.5}) {
      double z[] = {at - h, at, at + h};
      double slope[3], curvature[3], third[3], fourth[3];
      ActivateAll(activation, 3, z, slope, curvature, third, fourth);
      // h^2 / 6 times a fifth or sixth derivative of at most 60, and eps / h.
      EXPECT_NEAR(third[1], (curvature[2] - curvature[0]) / (2.0 * h), 2e-9)
          << ActivationName(activation) << " at " << at;
      EXPECT_NEAR(fourth[1], (third[2] - third[0]) / (2.0 * h), 2e-9)
          << ActivationName(activation) << " at " << at;
    }
  }
}

// v = x y^2 and w = sin(x) + y: (v w) and its derivatives by hand.
TEST(MultiplyJets, IsTheJetOfTheProduct) {
  const double x = 0.7;
  const double y = -1.2;
  MatrixXd v(1, 4), w(1, 4), product(1, 4);
  v << x * y * y, y * y, 2.0 * x * y, 2.0 * x;
  w << std::sin(x) + y, std::cos(x), 1.0, -std::sin(x);
  const double dx = y * y * w(0) + v(0) * std::cos(x);
  const double dy = 2.0 * x * y * w(0) + v(0);
  const double dxx = 2.0 * y * y * std::cos(x) - v(0) * std::sin(x);
  const double dyy = 2.0 * x * w(0) + 4.0 * x * y;
  product << v(0) * w(0), dx, dy, dxx + dyy;
  MatrixXd result = w;
  MultiplyJets(4, v, result);
  EXPECT_LT((result - product).norm(), 1e-15);
  MultiplyJets(4, w, v);  // symmetric
  EXPECT_LT((v - product).norm(), 1e-15);
}

TEST(MultiplyJets, TransposedIsTheAdjoint) {
  for (const int num_channels : {1, 3, 4, 7}) {
    const MatrixXd factors = RandomMatrix(3, 2 * num_channels, 1);
    const MatrixXd v = RandomMatrix(3, 2 * num_channels, 2);
    const MatrixXd w = RandomMatrix(3, 2 * num_channels, 3);
    MatrixXd Jv = v;
    MatrixXd Jtw = w;
    MultiplyJets(num_channels, factors, Jv);
    MultiplyJetsTransposed(num_channels, factors, Jtw);
    EXPECT_NEAR(Jv.cwiseProduct(w).sum(), Jtw.cwiseProduct(v).sum(), 1e-14);
  }
}

TEST(ForwardJets, OfOneNeuronIsTheClosedForm) {
  // f = 2 tanh(z) + 0.25, z = 0.3 a_1 - 1.1 a_2 + 0.4: grad z = (0.3, -1.1).
  const DenseNetwork network({2, 1, 1}, Activation::kTanh);
  VectorXd weights(5);
  weights << 0.3, -1.1, 0.4, 2.0, 0.25;
  const Vector2d a(0.6, 0.9);
  DenseNetwork::Activations activations;
  network.ForwardJets(weights, a, false, &activations);
  const double t = std::tanh(0.3 * a[0] - 1.1 * a[1] + 0.4);
  const double s = 1.0 - t * t;
  MatrixXd expected(1, 4);
  expected << 2.0 * t + 0.25, 2.0 * s * 0.3, -2.0 * s * 1.1,
      -4.0 * t * s * (0.3 * 0.3 + 1.1 * 1.1);
  EXPECT_LT((activations.outputs - expected).norm(), 1e-14);
}

TEST(ForwardJets, IsThatOfJetsOfJets) {
  for (const Activation activation : kSmoothActivations) {
    const DenseNetwork network({2, 5, 4, 3}, activation);
    const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
    const MatrixXd points = RandomMatrix(2, 3, 2);
    DenseNetwork::Activations jets, plain;
    network.ForwardJets(weights, points, false, &jets);
    network.Forward(weights, points, false, &plain);
    ASSERT_EQ(jets.outputs.cols(), 12);
    for (int s = 0; s < 3; ++s) {
      const MatrixXd expected = JetsByFunctor(network, weights, points.col(s));
      EXPECT_LT((jets.outputs.middleCols(4 * s, 4) - expected).norm(),
                kRounding)
          << network.Name();
      EXPECT_LT((jets.outputs.col(4 * s) - plain.outputs.col(s)).norm(), 1e-14);
      if (activation == Activation::kLinear) {
        EXPECT_EQ(jets.outputs.col(4 * s + 3).norm(), 0.0);
      }
    }
  }
}

TEST(ForwardJetsDeathTest, RefusesRelu) {
  const DenseNetwork network({2, 3, 1}, Activation::kRelu);
  DenseNetwork::Activations activations;
  EXPECT_DEATH(network.ForwardJets(VectorXd::Zero(network.num_weights()),
                                   MatrixXd::Zero(2, 1),
                                   false,
                                   &activations),
               "ReLU has no Laplacian");
}

}  // namespace two_jet_test
}  // namespace invgrad
