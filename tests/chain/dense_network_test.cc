#include "invgrad/dense_network.h"

#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/nested_jet.h"
#include "invgrad/random.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace dense_network_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Networks of up to four layers and about fifty weights: sums of that many
// terms of order one differ by some 1e-15 between two orders of summation.
constexpr double kRounding = 1e-13;

// The functor's outputs for weights moved along constant directions.
template <typename T>
std::vector<T> Outputs(const DenseNetwork& network,
                       const std::vector<T>& weights,
                       const VectorXd& input) {
  std::vector<T> inputs;
  for (const double a : input) inputs.push_back(T(a));
  std::vector<T> outputs(network.num_outputs());
  EXPECT_TRUE(
      NetworkFunctor(network)(weights.data(), inputs.data(), outputs.data()));
  return outputs;
}

class DenseNetworkTest : public testing::TestWithParam<
                             std::tuple<Activation, std::vector<int>, int>> {
 protected:
  DenseNetworkTest()
      : network_(std::get<1>(GetParam()), std::get<0>(GetParam())),
        batch_size_(std::get<2>(GetParam())),
        weights_(RandomMatrix(network_.num_weights(), 1, 1)),
        inputs_(RandomMatrix(network_.num_inputs(), batch_size_, 2)) {
    network_.Forward(weights_, inputs_, true, &activations_);
  }

  // J_s v by Jets through the functor, a column a sample.
  MatrixXd TangentByJets(const VectorXd& v) const {
    using Jet = ceres::Jet<double, 1>;
    MatrixXd tangents(network_.num_outputs(), batch_size_);
    std::vector<Jet> weights(network_.num_weights());
    for (int k = 0; k < network_.num_weights(); ++k) {
      weights[k].a = weights_[k];
      weights[k].v[0] = v[k];
    }
    for (int s = 0; s < batch_size_; ++s) {
      const auto outputs = Outputs(network_, weights, inputs_.col(s));
      for (int i = 0; i < network_.num_outputs(); ++i) {
        tangents(i, s) = outputs[i].v[0];
      }
    }
    return tangents;
  }

  const DenseNetwork network_;
  const int batch_size_;
  const VectorXd weights_;
  const MatrixXd inputs_;
  DenseNetwork::Activations activations_;
};

TEST_P(DenseNetworkTest, ForwardIsTheFunctor) {
  const std::vector<double> weights(weights_.begin(), weights_.end());
  for (int s = 0; s < batch_size_; ++s) {
    const auto outputs = Outputs(network_, weights, inputs_.col(s));
    for (int i = 0; i < network_.num_outputs(); ++i) {
      EXPECT_NEAR(activations_.outputs(i, s), outputs[i], kRounding);
    }
  }
}

TEST_P(DenseNetworkTest, TangentIsTheFunctorsJet) {
  const VectorXd v = RandomMatrix(network_.num_weights(), 1, 3);
  MatrixXd tangents;
  network_.Tangent(weights_, activations_, v, &tangents);
  EXPECT_LT((tangents - TangentByJets(v)).cwiseAbs().maxCoeff(), kRounding);
}

TEST_P(DenseNetworkTest, BackwardIsTheFunctorsJet) {
  const MatrixXd w = RandomMatrix(network_.num_outputs(), batch_size_, 4);
  VectorXd gradient;
  network_.Backward(weights_, activations_, w, &gradient);
  ASSERT_EQ(gradient.size(), network_.num_weights());
  for (int k = 0; k < network_.num_weights(); ++k) {
    const MatrixXd tangents =
        TangentByJets(VectorXd::Unit(network_.num_weights(), k));
    EXPECT_NEAR(gradient[k], tangents.cwiseProduct(w).sum(), kRounding) << k;
  }
}

// sum_s F_s(f(a_s)) with F_s(x) = w_s . (x - x_s) + 1/2 (x - x_s) . X_s
// (x - x_s), x_s = f(a_s) here and now: dF_s/dx = w_s, d2F_s/dx2 = X_s.
TEST_P(DenseNetworkTest, InputJacobiansAreTheFunctorsJets) {
  using Jet = ceres::Jet<double, 1>;
  MatrixXd jacobians;
  network_.InputJacobians(weights_, activations_, &jacobians);
  const int num_outputs = network_.num_outputs();
  ASSERT_EQ(jacobians.rows(), network_.num_inputs());
  ASSERT_EQ(jacobians.cols(), batch_size_ * num_outputs);
  const std::vector<Jet> weights(weights_.begin(), weights_.end());
  for (int s = 0; s < batch_size_; ++s) {
    for (int k = 0; k < network_.num_inputs(); ++k) {
      std::vector<Jet> inputs;
      for (const double a : inputs_.col(s)) inputs.emplace_back(a);
      inputs[k].v[0] = 1.0;
      std::vector<Jet> outputs(num_outputs);
      ASSERT_TRUE(NetworkFunctor(network_)(
          weights.data(), inputs.data(), outputs.data()));
      for (int i = 0; i < num_outputs; ++i) {
        EXPECT_NEAR(
            jacobians(k, s * num_outputs + i), outputs[i].v[0], kRounding);
      }
    }
  }
}

TEST_P(DenseNetworkTest, HessianIsTheFunctorsNestedJet) {
  using Jet = NestedJet<1>;
  const int n = network_.num_weights();
  const int num_outputs = network_.num_outputs();
  const MatrixXd w = RandomMatrix(num_outputs, batch_size_, 5);
  std::vector<MatrixXd> X;
  for (int s = 0; s < batch_size_; ++s) {
    const MatrixXd A = RandomMatrix(num_outputs, num_outputs, 6 + s);
    X.push_back(A + A.transpose());
  }
  MatrixXd hessian;
  network_.Hessian(weights_, activations_, w, X, &hessian);
  ASSERT_EQ(hessian.rows(), n);
  ASSERT_EQ(hessian.cols(), n);
  EXPECT_EQ((hessian - hessian.transpose()).cwiseAbs().maxCoeff(), 0.0);

  for (int row = 0; row < n; ++row) {
    for (int col = 0; col <= row; ++col) {
      std::vector<Jet> weights(n);
      for (int k = 0; k < n; ++k) weights[k] = Jet(InnerJet<1>(weights_[k]));
      weights[row].v[0] = InnerJet<1>(1.0);
      weights[col].a.v[0] = 1.0;
      double expected = 0.0;
      for (int s = 0; s < batch_size_; ++s) {
        const auto x = Outputs(network_, weights, inputs_.col(s));
        for (int i = 0; i < num_outputs; ++i) {
          expected += w(i, s) * x[i].v[0].v[0];
          for (int j = 0; j < num_outputs; ++j) {
            expected += x[i].v[0].a * X[s](i, j) * x[j].a.v[0];
          }
        }
      }
      EXPECT_NEAR(hessian(row, col), expected, 10 * kRounding)
          << row << ", " << col;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All,
    DenseNetworkTest,
    testing::Combine(testing::ValuesIn(kActivations),
                     testing::Values(std::vector<int>{3, 2},
                                     std::vector<int>{2, 4, 1},
                                     std::vector<int>{3, 4, 2, 3},
                                     std::vector<int>{1, 3, 2, 2, 2}),
                     testing::Values(1, 5)));

// In numpy: x = W2 tanh(W1 a + b1) + b2, theta = concatenate of
// hstack([W, b[:, None]]).ravel().
TEST(DenseNetworkLayout, IsRowByRowWithTheBiasLast) {
  const DenseNetwork network({2, 2, 1}, Activation::kTanh);
  ASSERT_EQ(network.num_weights(), 9);
  EXPECT_EQ(network.offset(0), 0);
  EXPECT_EQ(network.offset(1), 6);
  VectorXd weights(9);
  weights << 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9;
  DenseNetwork::Activations activations;
  network.Forward(weights, Eigen::Vector2d(2.0, -3.0), false, &activations);
  const double h0 = std::tanh(0.1 * 2.0 - 0.2 * 3.0 + 0.3);
  const double h1 = std::tanh(0.4 * 2.0 - 0.5 * 3.0 + 0.6);
  EXPECT_NEAR(activations.outputs(0, 0), 0.7 * h0 + 0.8 * h1 + 0.9, 1e-15);
  EXPECT_EQ(network.Name(), "2-2-1 tanh");
}

TEST(DenseNetworkForward, ReusesTheMemoryOfABatchOfTheSameSize) {
  const DenseNetwork network({3, 4, 2}, Activation::kGelu);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
  DenseNetwork::Activations activations;
  network.Forward(weights, RandomMatrix(3, 6, 2), true, &activations);
  const double* outputs = activations.outputs.data();
  const double* hidden = activations.inputs[1].data();
  network.Forward(weights, RandomMatrix(3, 6, 3), true, &activations);
  EXPECT_EQ(activations.outputs.data(), outputs);
  EXPECT_EQ(activations.inputs[1].data(), hidden);
}

// PyTorch and TensorFlow give ReLU the slope 0 at 0.
TEST(ActivationTest, ReluIsFlatAtZero) {
  double z = 0.0;
  double derivatives[] = {1.0, 1.0};
  ActivateAll(Activation::kRelu, 1, &z, 2, derivatives);
  EXPECT_EQ(z, 0.0);
  EXPECT_EQ(derivatives[0], 0.0);
  EXPECT_EQ(derivatives[1], 0.0);
  using Jet = ceres::Jet<double, 1>;
  EXPECT_EQ(Activate(Activation::kRelu, Jet(0.0, 0)).v[0], 0.0);
}

// Phi(-10) = 7.619853024160527e-24, Phi(1) = 0.841344746068543 (tables).
TEST(ActivationTest, GeluIsExactInItsTails) {
  double z[] = {-10.0, 1.0};
  ActivateAll(Activation::kGelu, 2, z, 0, nullptr);
  EXPECT_NEAR(z[0] / -7.619853024160527e-23, 1.0, 1e-14);
  EXPECT_NEAR(z[1], 0.841344746068543, 1e-15);
}

TEST(ActivationTest, SaturatesWithoutOverflow) {
  for (const Activation activation :
       {Activation::kTanh, Activation::kSigmoid, Activation::kGelu}) {
    for (const double sign : {-1.0, 1.0}) {
      const double at = sign * 1000.0;
      double z = at;
      double derivatives[] = {-1.0, -1.0};
      ActivateAll(activation, 1, &z, 2, derivatives);
      const bool rises = activation == Activation::kGelu && sign > 0.0;
      EXPECT_EQ(derivatives[0], rises ? 1.0 : 0.0);
      EXPECT_EQ(derivatives[1], 0.0);
      using Jet = ceres::Jet<double, 1>;
      const Jet jet = Activate(activation, Jet(at, 0));
      EXPECT_EQ(jet.a, z);
      EXPECT_EQ(jet.v[0], derivatives[0]);
    }
  }
}

TEST(ActivationTest, NanTravels) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Activation activation : kActivations) {
    double z = nan;
    ActivateAll(activation, 1, &z, 0, nullptr);
    EXPECT_TRUE(std::isnan(z)) << ActivationName(activation);
    EXPECT_TRUE(std::isnan(Activate(activation, nan)));
  }
}

// A uniform distribution on [-s, s] has variance s^2 / 3; the estimate from N
// values has a relative standard deviation of sqrt(4 / (5 N)): 1.3 % here, of
// which four are allowed.
TEST(InitialWeightsTest, HaveTheStatedBoundsAndVariance) {
  const int fan_in = 60;
  const int fan_out = 80;
  const DenseNetwork network({fan_in, fan_out}, Activation::kTanh);
  const struct {
    Initialization initialization;
    double bound;
  } kCases[] = {{Initialization::kGlorotUniform, std::sqrt(6.0 / 140.0)},
                {Initialization::kHeUniform, std::sqrt(6.0 / 60.0)},
                {Initialization::kPytorch, 1.0 / std::sqrt(60.0)}};
  for (const auto& c : kCases) {
    NumpyRandom random(7);
    VectorXd weights = network.InitialWeights(c.initialization, &random);
    const Eigen::Map<MatrixXd> layer(weights.data(), fan_in + 1, fan_out);
    const auto matrix = layer.topRows(fan_in);
    EXPECT_LE(matrix.cwiseAbs().maxCoeff(), c.bound);
    EXPECT_GT(matrix.cwiseAbs().maxCoeff(), 0.99 * c.bound);
    EXPECT_NEAR(matrix.squaredNorm() / matrix.size() / (c.bound * c.bound / 3),
                1.0,
                0.052);
    const auto biases = layer.row(fan_in);
    EXPECT_LE(biases.cwiseAbs().maxCoeff(), c.bound);
    EXPECT_EQ(biases.cwiseAbs().minCoeff() > 0.0,
              c.initialization == Initialization::kPytorch);
    EXPECT_EQ(biases.cwiseAbs().maxCoeff() > 0.0,
              c.initialization == Initialization::kPytorch);
  }
}

// Row by row, then the biases: the order in which numpy would draw them.
TEST(InitialWeightsTest, AreDrawnAsNumpyWould) {
  const DenseNetwork network({2, 2, 1}, Activation::kTanh);
  NumpyRandom random(3);
  const VectorXd weights =
      network.InitialWeights(Initialization::kPytorch, &random);
  NumpyRandom again(3);
  const double s = 1.0 / std::sqrt(2.0);
  for (const int index : {0, 1, 3, 4, 2, 5, 6, 7, 8}) {
    EXPECT_EQ(weights[index], again.Uniform(-s, s)) << index;
  }
}

}  // namespace dense_network_test
}  // namespace invgrad
