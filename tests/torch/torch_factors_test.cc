// The Kronecker factors of convolutions and linear layers, and K-FAC with them.

#include "invgrad/torch/torch_factors.h"

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/torch/u_net.h"
#include "invgrad/torch_network.h"
#include "tests/support/random_matrix.h"
#include "tests/torch/sequential_network.h"

namespace invgrad {
namespace torch_factors_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;
namespace nn = torch::nn;

// A pass at random weights.
struct Pass {
  Pass(std::shared_ptr<const Network> of, const MatrixXd& inputs)
      : network(std::move(of)),
        weights(RandomMatrix(network->num_weights(), 1, 1)),
        pass(network->NewPass()) {
    std::string error;
    EXPECT_TRUE(network->Forward(
        weights, inputs, Network::Derivatives::kFirst, pass.get(), &error))
        << error;
  }
  SampledFactors Factors(const MatrixXd& w) const {
    SampledFactors factors;
    FactorsOf(*network, weights, *pass, w, &factors);
    return factors;
  }
  VectorXd Gradient(const MatrixXd& w) const {
    VectorXd gradient;
    network->Backward(weights, *pass, w, &gradient);
    return gradient;
  }
  // J without a simulator, for the loss 2 |x - x*|^2.
  Linearization TakeLinearization() {
    Linearization at_x;
    at_x.loss_gradient =
        RandomMatrix(network->num_outputs(), pass->num_columns(), 7).reshaped();
    at_x.loss_hessian_times = [](const VectorXd& v) -> VectorXd {
      return 4.0 * v;
    };
    at_x.jacobian = std::make_shared<ChainJacobian>(
        network,
        weights,
        std::move(pass),
        nullptr,
        std::vector<std::unique_ptr<const JacobianOperator>>());
    return at_x;
  }

  std::shared_ptr<const Network> network;
  VectorXd weights;
  std::unique_ptr<Network::Pass> pass;
};

void ExpectNear(const MatrixXd& actual, const MatrixXd& expected) {
  ASSERT_EQ(actual.rows(), expected.rows());
  ASSERT_EQ(actual.cols(), expected.cols());
  EXPECT_LE((actual - expected).norm(), 1e-12 * expected.norm());
}

// A convolution 3x3 from 2 to 3 channels with tanh on 4 x 5 cells, its patches
// cell by cell.
TEST(TorchFactors, AreSumsOverThePatches) {
  constexpr int kRows = 4, kCols = 5, kCells = kRows * kCols, kSamples = 3;
  for (const bool periodic : {false, true}) {
    SCOPED_TRACE(periodic);
    nn::Conv2dOptions options(2, 3, 3);
    options.padding(1);
    if (periodic) options.padding_mode(torch::kCircular);
    const MatrixXd inputs = RandomMatrix(2 * kCells, kSamples, 2);
    const Pass pass(
        MakeSequential(nn::Sequential(nn::Conv2d(options), nn::Tanh()),
                       {2, kRows, kCols}),
        inputs);
    const MatrixXd w = RandomMatrix(3 * kCells, kSamples, 3);
    MatrixXd a = MatrixXd::Zero(19, kCells * kSamples);
    a.row(18).setOnes();
    MatrixXd delta(3, kCells * kSamples);
    for (int s = 0; s < kSamples; ++s) {
      for (int cell = 0; cell < kCells; ++cell) {
        const int t = s * kCells + cell;
        for (int i = 0; i < 18; ++i) {
          int row = cell / kCols + i % 9 / 3 - 1;
          int col = cell % kCols + i % 3 - 1;
          if (periodic) {
            row = (row + kRows) % kRows;
            col = (col + kCols) % kCols;
          } else if (row < 0 || row >= kRows || col < 0 || col >= kCols) {
            continue;
          }
          a(i, t) = inputs(i / 9 * kCells + row * kCols + col, s);
        }
        for (int c = 0; c < 3; ++c) {
          const double y = pass.pass->outputs(c * kCells + cell, s);
          delta(c, t) = w(c * kCells + cell, s) * (1.0 - y * y);
        }
      }
    }
    const SampledFactors factors = pass.Factors(w);
    const std::vector<LayerColumns> columns = FactorLayersOf(*pass.network);
    ASSERT_EQ(factors.layers.size(), 1u);
    ExpectNear(factors.layers[0].A, a * a.transpose() / (kCells * kSamples));
    ExpectNear(factors.layers[0].D, delta * delta.transpose());
    EXPECT_EQ(factors.others, VectorXd::Zero(57));
    // Each weight has its column.
    const VectorXd gradient = pass.Gradient(w);
    ExpectNear(gradient(columns[0].reshaped()).reshaped(19, 3),
               a * delta.transpose());
  }
}

TEST(TorchFactors, SamplesAreTakenInParts) {
  // 9 MB of patches a sample.
  const auto network = MakeSequential(
      nn::Sequential(nn::Conv2d(nn::Conv2dOptions(8, 1, 3).stride(2))),
      {8, 257, 257});
  const MatrixXd inputs = RandomMatrix(network->num_inputs(), 3, 2);
  const MatrixXd w = RandomMatrix(network->num_outputs(), 3, 3);
  MatrixXd A = MatrixXd::Zero(73, 73);
  MatrixXd D = MatrixXd::Zero(1, 1);
  for (int s = 0; s < 3; ++s) {
    const SampledFactors of_sample =
        Pass(network, inputs.col(s)).Factors(w.col(s));
    A += of_sample.layers[0].A / 3.0;
    D += of_sample.layers[0].D;
  }
  const SampledFactors factors = Pass(network, inputs).Factors(w);
  ExpectNear(factors.layers[0].A, A);
  ExpectNear(factors.layers[0].D, D);
}

// libtorch has the matrix of a layer, then its biases; a DenseNetwork the
// weights and the bias of each unit.
TEST(TorchFactors, AgreeWithADenseNetwork) {
  const MatrixXd inputs = RandomMatrix(3, 6, 2);
  Pass pass(
      MakeSequential(
          nn::Sequential(nn::Linear(3, 4), nn::Tanh(), nn::Linear(4, 2)), {3}),
      inputs);
  const auto dense = std::make_shared<DenseNetwork>(std::vector<int>{3, 4, 2},
                                                    Activation::kTanh);
  Pass dense_pass(dense, inputs);
  std::vector<LayerColumns> columns = FactorLayersOf(*pass.network);
  std::vector<LayerColumns> dense_columns = FactorLayersOf(*dense);
  ASSERT_EQ(columns.size(), 2u);
  for (int l = 0; l < 2; ++l) {
    dense_pass.weights(dense_columns[l].reshaped()) =
        pass.weights(columns[l].reshaped()).eval();
  }
  dense->Forward(
      dense_pass.weights,
      inputs,
      false,
      dynamic_cast<DenseNetwork::Activations*>(dense_pass.pass.get()));
  const MatrixXd w = RandomMatrix(2, 6, 3);
  const SampledFactors factors = pass.Factors(w);
  const SampledFactors dense_factors = dense_pass.Factors(w);
  for (int l = 0; l < 2; ++l) {
    ExpectNear(factors.layers[l].A, dense_factors.layers[l].A);
    ExpectNear(factors.layers[l].D, dense_factors.layers[l].D);
  }

  const Linearization at_x = pass.TakeLinearization();
  const Linearization at_dense = dense_pass.TakeLinearization();
  const auto rule = MakeRule("kfac");
  const auto dense_rule = MakeRule("kfac");
  for (int k = 0; k < 3; ++k) {
    VectorXd step, dense_step;
    std::string error;
    ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
    ASSERT_TRUE(dense_rule->ComputeStep(at_dense, &dense_step, &error));
    for (int l = 0; l < 2; ++l) {
      EXPECT_LT((step(columns[l].reshaped()) -
                 dense_step(dense_columns[l].reshaped()))
                    .norm(),
                1e-10 * step.norm());
    }
  }
}

// One sample with one cell has one a and one delta: A (x) D is the square of its
// gradient, and K-FAC's step that of the Gauss-Newton matrix along w.
TEST(TorchFactors, OfOneCellAreTheGaussNewtonMatrix) {
  const Pass pass(
      MakeSequential(nn::Sequential(nn::Conv2d(2, 3, 1), nn::Tanh()),
                     {2, 1, 1}),
      RandomMatrix(2, 1, 2));
  const MatrixXd w = RandomMatrix(3, 1, 3);
  const SampledFactors::Layer layer = pass.Factors(w).layers[0];
  const VectorXd gradient =
      pass.Gradient(w)(FactorLayersOf(*pass.network)[0].reshaped());
  MatrixXd product(9, 9);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      product.block(3 * i, 3 * k, 3, 3) = layer.D(i, k) * layer.A;
    }
  }
  ExpectNear(product, gradient * gradient.transpose());
}

// A layer that is called twice, without a bias.
struct Twice : nn::Module {
  Twice() { register_module("layer", layer); }
  Tensor forward(const Tensor& x) {
    return layer->forward(x) + layer->forward(2.0 * x);
  }
  nn::Linear layer{nn::LinearOptions(3, 2).bias(false)};
};

TEST(TorchFactors, SumOverTheCallsOfALayer) {
  TorchNetworkOptions options;
  options.input_shape = {3};
  options.double_precision = true;
  std::string error;
  const auto network = MakeTorchNetwork(
      [] { return FunctionOfModule(std::make_shared<Twice>()); },
      options,
      &error);
  ASSERT_NE(network, nullptr) << error;
  const MatrixXd inputs = RandomMatrix(3, 5, 2);
  const MatrixXd w = RandomMatrix(2, 5, 3);
  const SampledFactors factors = Pass(network, inputs).Factors(w);
  ASSERT_EQ(factors.layers.size(), 1u);
  ExpectNear(factors.layers[0].A, 5.0 * inputs * inputs.transpose() / 10.0);
  ExpectNear(factors.layers[0].D, 2.0 * w * w.transpose());
}

// Batch normalization and a convolution in groups belong to no layer.
TEST(TorchFactors, OtherWeightsHaveTheDampedDiagonal) {
  Pass pass(MakeSequential(
                nn::Sequential(
                    nn::Conv2d(2, 4, 3),
                    nn::BatchNorm2d(
                        nn::BatchNorm2dOptions(4).track_running_stats(false)),
                    nn::Conv2d(nn::Conv2dOptions(4, 4, 1).groups(2))),
                {2, 5, 5}),
            RandomMatrix(50, 6, 2));
  const std::vector<LayerColumns> columns = FactorLayersOf(*pass.network);
  ASSERT_EQ(columns.size(), 1u);
  EXPECT_EQ(columns[0].size(), 76);
  // The 76 weights of the first convolution come first.
  EXPECT_EQ(columns[0].maxCoeff(), 75);
  const MatrixXd w = RandomMatrix(36, 6, 3);
  const VectorXd others = pass.Factors(w).others;
  ExpectNear(others.tail(20), pass.Gradient(w).tail(20));
  EXPECT_TRUE(others.head(76).isZero(0.0));

  const Linearization at_x = pass.TakeLinearization();
  VectorXd step, gradient, diagonal;
  std::string error;
  ASSERT_TRUE(MakeRule("kfac:step_size=0.5:damping=3:seed=2")
                  ->ComputeStep(at_x, &step, &error))
      << error;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
  at_x.jacobian->TransposeTimes(2.0 * NumpyRandom(2).Normal(36 * 6), &diagonal);
  ExpectNear(
      step.tail(20),
      -0.5 * gradient.tail(20).cwiseQuotient(
                 (diagonal.tail(20).cwiseAbs2().array() + 3.0).matrix()));
}

TEST(TorchFactors, OfAUNetAreThoseOfItsConvolutions) {
  UNetOptions options;
  options.rows = options.cols = 32;
  std::string error;
  const auto network = MakeUNet(options, &error);
  ASSERT_NE(network, nullptr) << error;
  std::set<int> weights;
  Eigen::Index size = 0;
  for (const LayerColumns& layer : FactorLayersOf(*network)) {
    size += layer.size();
    weights.insert(layer.reshaped().begin(), layer.reshaped().end());
  }
  EXPECT_EQ(FactorLayersOf(*network).size(), 15u);
  // All but scale and shift of 14 batch normalizations of 16 channels.
  EXPECT_EQ(size, 37697 - 14 * 32);
  EXPECT_EQ(weights.size(), static_cast<std::size_t>(size));

  const MatrixXd inputs = RandomMatrix(1024, 16, 1);
  const Pass pass(network, inputs);
  const SampledFactors factors = pass.Factors(inputs);
  for (const SampledFactors::Layer& layer : factors.layers) {
    EXPECT_GT(layer.A.trace(), 0.0);
    EXPECT_GT(layer.D.trace(), 0.0);
  }
}

}  // namespace torch_factors_test
}  // namespace invgrad
