// The last layer of modules, and its features.

#include "invgrad/torch/torch_output_layer.h"

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/torch/u_net.h"
#include "invgrad/torch_network.h"
#include "tests/support/random_matrix.h"
#include "tests/torch/sequential_network.h"

namespace invgrad {
namespace torch_output_layer_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;
using Derivatives = Network::Derivatives;
namespace nn = torch::nn;

constexpr int kNumSamples = 3;

// C^T h as the outputs of the samples.
MatrixXd OutputsOfLayer(const Network& network,
                        const MatrixXd& C,
                        const MatrixXd& h) {
  const MatrixXd at_positions = h.transpose() * C;
  const Index num_positions = network.num_outputs() / C.cols();
  MatrixXd outputs(network.num_outputs(), h.cols() / num_positions);
  for (Index s = 0; s < outputs.cols(); ++s) {
    outputs.col(s) =
        at_positions.middleRows(s * num_positions, num_positions).reshaped();
  }
  return outputs;
}

MatrixXd LayerOf(const Network& network, const VectorXd& weights) {
  const LayerColumns layer = OutputLayerOf(network);
  return weights(layer.reshaped()).reshaped(layer.rows(), layer.cols());
}

std::unique_ptr<Network::Pass> PassOf(
    const Network& network,
    const VectorXd& weights,
    Derivatives derivatives = Derivatives::kFirst) {
  auto pass = network.NewPass();
  std::string error;
  EXPECT_TRUE(
      network.Forward(weights,
                      RandomMatrix(network.num_inputs(), kNumSamples, 2),
                      derivatives,
                      pass.get(),
                      &error))
      << error;
  return pass;
}

// A change of the layer changes the outputs by C^T h, and no feature.
void ExpectOutputsAreAffine(const Network& network) {
  const LayerColumns layer = OutputLayerOf(network);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
  const auto pass = PassOf(network, weights);
  const MatrixXd h = FeaturesOf(network, weights, *pass);
  ASSERT_EQ(h.rows(), layer.rows());
  ASSERT_EQ(h.cols() * layer.cols(), pass->outputs.size());
  VectorXd change = VectorXd::Zero(weights.size());
  change(layer.reshaped()) = RandomMatrix(layer.size(), 1, 3);
  const auto changed = PassOf(network, weights + change);
  EXPECT_EQ(FeaturesOf(network, weights + change, *changed), h);
  const MatrixXd difference = changed->outputs - pass->outputs;
  // Double precision, sums of at most 30 terms.
  EXPECT_LT((difference - OutputsOfLayer(network, LayerOf(network, change), h))
                .norm(),
            1e-13 * difference.norm());
}

struct Case {
  std::string name;
  nn::Sequential module;
  std::vector<int64_t> input_shape;
  std::pair<int, int> layer_size;  // fan_in, fan_out
};

nn::Conv2d Convolution(int in, int out, int size, bool bias = true) {
  return nn::Conv2d(nn::Conv2dOptions(in, out, size).bias(bias));
}

std::vector<Case> Cases() {
  using nn::Sequential;
  const nn::Linear with_bias(4, 2);
  const nn::Linear without(nn::LinearOptions(4, 2).bias(false));
  const auto padded = nn::Conv2dOptions(3, 2, 3).stride(2).padding(1);
  const auto shape = nn::UnflattenOptions(1, {2, 1});
  return {
      {"linear",
       Sequential(nn::Linear(3, 4), nn::Tanh(), with_bias),
       {3},
       {5, 2}},
      {"no_bias",
       Sequential(nn::Linear(3, 4), nn::Tanh(), without),
       {3},
       {4, 2}},
      {"unflattened",
       Sequential(
           nn::Linear(3, 4), nn::Tanh(), with_bias, nn::Unflatten(shape)),
       {3},
       {5, 2}},
      {"one_output_at_each_position",
       Sequential(nn::Linear(3, 4),
                  nn::Tanh(),
                  nn::Linear(nn::LinearOptions(4, 1).bias(false)),
                  nn::Flatten()),
       {5, 3},
       {4, 1}},
      {"pixels",
       Sequential(Convolution(2, 3, 3), nn::Tanh(), Convolution(3, 2, 1)),
       {2, 4, 5},
       {4, 2}},
      {"pixels_no_bias",
       Sequential(
           Convolution(2, 3, 3), nn::Tanh(), Convolution(3, 2, 1, false)),
       {2, 4, 5},
       {3, 2}},
      {"flattened_pixels",
       Sequential(Convolution(2, 3, 1),
                  nn::Tanh(),
                  Convolution(3, 2, 1),
                  nn::Flatten()),
       {2, 4, 5},
       {4, 2}},
      {"patches",
       Sequential(Convolution(2, 3, 1), nn::Tanh(), nn::Conv2d(padded)),
       {2, 4, 5},
       {28, 2}},
      {"batch_normalization",
       Sequential(Convolution(2, 3, 1),
                  nn::BatchNorm2d(
                      nn::BatchNorm2dOptions(3).track_running_stats(false)),
                  Convolution(3, 2, 1)),
       {2, 4, 5},
       {4, 2}},
  };
}

class EveryOutputLayer : public testing::TestWithParam<Case> {};

TEST_P(EveryOutputLayer, GivesTheOutputs) {
  const Case& of = GetParam();
  const auto network = MakeSequential(of.module, of.input_shape);
  const LayerColumns layer = OutputLayerOf(*network);
  ASSERT_EQ(layer.rows(), of.layer_size.first);
  ASSERT_EQ(layer.cols(), of.layer_size.second);
  EXPECT_EQ(layer.maxCoeff(), network->num_weights() - 1);
  ExpectOutputsAreAffine(*network);
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const auto pass = PassOf(*network, weights);
  const MatrixXd x = OutputsOfLayer(*network,
                                    LayerOf(*network, weights),
                                    FeaturesOf(*network, weights, *pass));
  EXPECT_LT((x - pass->outputs).norm(), 1e-13 * x.norm());
}

INSTANTIATE_TEST_SUITE_P(TorchOutputLayer,
                         EveryOutputLayer,
                         testing::ValuesIn(Cases()),
                         [](const auto& info) { return info.param.name; });

TEST(TorchOutputLayer, OfAPassWithoutAGraphOrOfOtherWeights) {
  const auto network = MakeSequential(
      nn::Sequential(nn::Linear(3, 4), nn::Tanh(), nn::Linear(4, 2)), {3});
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const auto pass = PassOf(*network, weights);
  const auto without = PassOf(*network, weights, Derivatives::kNone);
  const MatrixXd h = FeaturesOf(*network, weights, *pass);
  EXPECT_EQ(FeaturesOf(*network, weights, *without), h);
  PassOf(*network, 2.0 * weights);
  EXPECT_EQ(FeaturesOf(*network, weights, *pass), h);
}

TEST(TorchOutputLayer, ModulesWithoutOne) {
  using nn::Sequential;
  const auto has_one = [](const Sequential& module,
                          const std::vector<int64_t>& shape) {
    return OutputLayerOf(*MakeSequential(module, shape)).size() > 0;
  };
  const nn::Linear linear(3, 3);
  EXPECT_TRUE(has_one(Sequential(linear), {3}));
  EXPECT_FALSE(has_one(Sequential(linear, nn::Tanh()), {3}));
  EXPECT_FALSE(has_one(Sequential(linear, nn::Softplus()), {3}));
  EXPECT_FALSE(has_one(
      Sequential(linear, nn::LayerNorm(nn::LayerNormOptions({3}))), {3}));
  // The outputs of a position side by side are no blocks.
  const nn::Linear without_bias(nn::LinearOptions(3, 3).bias(false));
  EXPECT_TRUE(has_one(Sequential(without_bias), {3}));
  EXPECT_FALSE(has_one(Sequential(without_bias), {2, 3}));
  EXPECT_FALSE(has_one(
      Sequential(nn::Conv2d(nn::Conv2dOptions(2, 2, 1).groups(2))), {2, 4, 5}));
  EXPECT_FALSE(has_one(Sequential(nn::ConvTranspose2d(2, 3, 1)), {2, 4, 5}));
}

// A module that ends in a linear layer, from its features.
struct EndsInLinear : nn::Module {
  using End = std::function<Tensor(EndsInLinear*, const Tensor& a)>;
  explicit EndsInLinear(End of) : end(std::move(of)) {
    register_module("hidden", hidden);
    register_module("last", last);
  }
  Tensor forward(const Tensor& a) { return end(this, a); }
  nn::Linear hidden{3, 3};
  nn::Linear last{3, 3};
  End end;
};

std::shared_ptr<const Network> MakeEnd(const EndsInLinear::End& end,
                                       bool trains_bias = true) {
  TorchNetworkOptions options;
  options.input_shape = {3};
  options.double_precision = true;
  std::string error;
  auto network = MakeTorchNetwork(
      [&] {
        const auto module = std::make_shared<EndsInLinear>(end);
        module->last->bias.set_requires_grad(trains_bias);
        return FunctionOfModule(module);
      },
      options,
      &error);
  EXPECT_NE(network, nullptr) << error;
  return network;
}

TEST(TorchOutputLayer, WeightsThatAreUsedAgain) {
  const auto has_one = [](const EndsInLinear::End& end) {
    return OutputLayerOf(*MakeEnd(end)).size() > 0;
  };
  EXPECT_TRUE(has_one([](EndsInLinear* m, const Tensor& a) {
    return m->last(torch::tanh(m->hidden(a)));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return m->last(torch::tanh(m->last(a)));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return m->last(torch::tanh(torch::matmul(a, m->last->weight)));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return m->last(torch::tanh(m->hidden(a) * m->last->weight.sum()));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return m->last(torch::tanh(m->hidden(a) + m->last->bias));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return torch::linear(m->hidden(a), m->last->weight, m->last->weight.sum(0));
  }));
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return torch::linear(m->hidden(a), 2.0 * m->last->weight);
  }));
  // An input beside the layer.
  EXPECT_FALSE(has_one([](EndsInLinear* m, const Tensor& a) {
    return a + m->last(torch::tanh(m->hidden(a)));
  }));
}

// What is added to the layer's outputs does not depend on the layer.
TEST(TorchOutputLayer, BiasesThatAreNoParameters) {
  for (const bool is_constant : {true, false}) {
    SCOPED_TRACE(is_constant);
    const auto network = MakeEnd(
        [=](EndsInLinear* m, const Tensor& a) {
          const Tensor h = torch::tanh(m->hidden(a));
          return is_constant
                     ? m->last(h)
                     : torch::linear(
                           h, m->last->weight, m->hidden->weight.sum(0));
        },
        /*trains_bias=*/false);
    ASSERT_EQ(OutputLayerOf(*network).rows(), 3);
    ExpectOutputsAreAffine(*network);
  }
}

TEST(TorchOutputLayer, OfAUNetIsItsLastConvolution) {
  UNetOptions options;
  options.rows = options.cols = 8;
  options.levels = 2;
  options.filters = 4;
  options.in_channels = options.out_channels = 2;
  options.double_precision = true;
  std::string error;
  const auto network = MakeUNet(options, &error);
  ASSERT_NE(network, nullptr) << error;
  ASSERT_EQ(OutputLayerOf(*network).rows(), 5);
  ASSERT_EQ(OutputLayerOf(*network).cols(), 2);
  ExpectOutputsAreAffine(*network);
  options.keeps_mean = true;  // which subtracts the mean of the layer's outputs
  EXPECT_EQ(OutputLayerOf(*MakeUNet(options, &error)).size(), 0);
}

}  // namespace torch_output_layer_test
}  // namespace invgrad
