#include "invgrad/torch_network.h"

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/cost.h"
#include "invgrad/dense_network.h"
#include "invgrad/random.h"
#include "tests/support/random_matrix.h"
#include "tests/torch/network_identities.h"

namespace invgrad {
namespace torch_network_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;
using Derivatives = Network::Derivatives;

// 3-4-2 tanh.
struct Dense : torch::nn::Module {
  Dense() {
    register_module("first", first);
    register_module("second", second);
  }
  Tensor forward(const Tensor& x) {
    return second->forward(torch::tanh(first->forward(x)));
  }
  torch::nn::Linear first{3, 4};
  torch::nn::Linear second{4, 2};
};

TorchNetworkOptions Options(std::vector<int64_t> shape, bool double_precision) {
  TorchNetworkOptions options;
  options.name = "test";
  options.input_shape = std::move(shape);
  options.double_precision = double_precision;
  return options;
}

template <typename Module>
std::shared_ptr<const Network> Make(const TorchNetworkOptions& options,
                                    std::string* error) {
  return MakeTorchNetwork(
      [] { return FunctionOfModule(std::make_shared<Module>()); },
      options,
      error);
}

std::shared_ptr<const Network> MakeDense(bool double_precision) {
  std::string error;
  auto network = Make<Dense>(Options({3}, double_precision), &error);
  EXPECT_NE(network, nullptr) << error;
  return network;
}

// The weights of the DenseNetwork with the same output: libtorch has the matrix
// of a layer, then its biases; a DenseNetwork the weights and the bias of each
// unit.
VectorXd ForDenseNetwork(const VectorXd& weights) {
  VectorXd dense(weights.size());
  int first = 0, out = 0;
  for (const auto& [fan_in, fan_out] : {std::pair(3, 4), std::pair(4, 2)}) {
    for (int unit = 0; unit < fan_out; ++unit) {
      for (int i = 0; i < fan_in; ++i) {
        dense[out++] = weights[first + unit * fan_in + i];
      }
      dense[out++] = weights[first + fan_out * fan_in + unit];
    }
    first += fan_out * (fan_in + 1);
  }
  return dense;
}

TEST(TorchNetwork, AgreesWithADenseNetwork) {
  const auto network = MakeDense(/*double_precision=*/true);
  const DenseNetwork dense({3, 4, 2}, Activation::kTanh);
  ASSERT_EQ(network->num_weights(), dense.num_weights());
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const MatrixXd inputs = RandomMatrix(3, 5, 2);
  const MatrixXd w = RandomMatrix(2, 5, 3);
  const VectorXd v = RandomMatrix(network->num_weights(), 1, 4);
  EXPECT_LT((network->Outputs(weights, inputs) -
             dense.Outputs(ForDenseNetwork(weights), inputs))
                .norm(),
            1e-14);

  const MatrixXd none = network->Outputs(weights, inputs.leftCols(0));
  EXPECT_EQ(none.rows(), 2);
  EXPECT_EQ(none.cols(), 0);

  const auto pass = network->NewPass();
  const auto dense_pass = dense.NewPass();
  std::string error;
  ASSERT_TRUE(network->Forward(
      weights, inputs, Derivatives::kFirst, pass.get(), &error));
  ASSERT_TRUE(dense.Forward(ForDenseNetwork(weights),
                            inputs,
                            Derivatives::kFirst,
                            dense_pass.get(),
                            &error));
  VectorXd gradient, dense_gradient;
  network->Backward(weights, *pass, w, &gradient);
  dense.Backward(ForDenseNetwork(weights), *dense_pass, w, &dense_gradient);
  EXPECT_LT((ForDenseNetwork(gradient) - dense_gradient).norm(), 1e-14);
  MatrixXd tangents, dense_tangents;
  network->Tangent(weights, *pass, v, &tangents);
  dense.Tangent(ForDenseNetwork(weights),
                *dense_pass,
                ForDenseNetwork(v),
                &dense_tangents);
  EXPECT_LT((tangents - dense_tangents).norm(), 1e-14);
}

// As cost functions of Ceres, of the weights and of the input.
TEST(TorchNetwork, HasTheCostFunctionsOfADenseNetwork) {
  const auto network = MakeDense(/*double_precision=*/true);
  const auto dense = std::make_shared<DenseNetwork>(std::vector<int>{3, 4, 2},
                                                    Activation::kTanh);
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const VectorXd input = RandomMatrix(3, 1, 2);
  const VectorXd target = RandomMatrix(2, 1, 3);
  const auto evaluate = [&](const ceres::CostFunction& cost,
                            const double* parameters,
                            std::vector<MatrixXd>* jacobians) {
    std::vector<const double*> blocks;
    std::vector<double*> pointers;
    for (const int size : cost.parameter_block_sizes()) {
      blocks.push_back(parameters);
      parameters += size;
      jacobians->emplace_back(size, 2);
    }
    for (MatrixXd& J : *jacobians) pointers.push_back(J.data());
    VectorXd residuals(2);
    EXPECT_TRUE(
        cost.Evaluate(blocks.data(), residuals.data(), pointers.data()));
    return residuals;
  };
  std::vector<MatrixXd> J, J_dense;
  VectorXd r =
      evaluate(TrainedNetworkCost(network, weights, target), input.data(), &J);
  EXPECT_LT(
      (r - evaluate(TrainedNetworkCost(dense, ForDenseNetwork(weights), target),
                    input.data(),
                    &J_dense))
          .norm(),
      1e-14);
  EXPECT_LT((J[0] - J_dense[0]).norm(), 1e-14);

  J.clear();
  r = evaluate(NetworkCost(network, input, target), weights.data(), &J);
  EXPECT_LT((r - (network->Outputs(weights, input) - target)).norm(), 1e-14);
  VectorXd of_row(network->num_weights());
  Eigen::Index first = 0;
  for (const MatrixXd& block : J) {
    of_row.segment(first, block.rows()) = block.col(1);
    first += block.rows();
  }
  const auto pass = network->NewPass();
  std::string error;
  ASSERT_TRUE(network->Forward(
      weights, input, Derivatives::kFirst, pass.get(), &error));
  VectorXd gradient;
  network->Backward(weights, *pass, Eigen::Vector2d(0.0, 1.0), &gradient);
  EXPECT_LT((of_row - gradient).norm(), 1e-14);
}

TEST(TorchNetwork, SinglePrecisionIsNearDoublePrecision) {
  const VectorXd weights = RandomMatrix(26, 1, 1);
  const MatrixXd inputs = RandomMatrix(3, 5, 2);
  const MatrixXd difference = MakeDense(false)->Outputs(weights, inputs) -
                              MakeDense(true)->Outputs(weights, inputs);
  EXPECT_LT(difference.norm(), 1e-5);
  EXPECT_GT(difference.norm(), 0.0);
}

// A pass keeps its derivatives while the network computes at other weights.
TEST(TorchNetwork, PassesOfDifferentWeightsDoNotMix) {
  const auto network = MakeDense(true);
  const VectorXd here = RandomMatrix(26, 1, 1), there = RandomMatrix(26, 1, 2);
  const MatrixXd inputs = RandomMatrix(3, 5, 3);
  const MatrixXd w = RandomMatrix(2, 5, 4);
  const auto pass = network->NewPass();
  std::string error;
  VectorXd before, after;
  MatrixXd tangents_before, tangents_after;
  ASSERT_TRUE(
      network->Forward(here, inputs, Derivatives::kFirst, pass.get(), &error));
  network->Backward(here, *pass, w, &before);
  network->Tangent(here, *pass, before, &tangents_before);
  network->Outputs(there, inputs);
  network->Backward(here, *pass, w, &after);
  EXPECT_EQ(before, after);
  network->Outputs(there, inputs);
  network->Tangent(here, *pass, before, &tangents_after);
  EXPECT_EQ(tangents_before, tangents_after);
}

TEST(TorchNetwork, InitialWeightsDependOnTheSeedAlone) {
  const auto network = MakeDense(false);
  const auto weights = [&network](int seed) -> VectorXd {
    NumpyRandom random(seed);
    return network->InitialWeights(Initialization::kGlorotUniform, &random);
  };
  EXPECT_EQ(weights(3), weights(3));
  EXPECT_NE(weights(3), weights(4));
  // nn.Linear: U(-1 / sqrt(fan_in), 1 / sqrt(fan_in)).
  EXPECT_LE(weights(3).head(16).cwiseAbs().maxCoeff(), 1.0 / std::sqrt(3.0));
}

TEST(TorchNetwork, InitialWeightsLeaveTheProgramsRandomNumbersAlone) {
  const auto network = MakeDense(false);
  torch::manual_seed(7);
  const torch::Tensor undisturbed = torch::randn(5);
  torch::manual_seed(7);
  NumpyRandom random(1);
  network->InitialWeights(Initialization::kGlorotUniform, &random);
  EXPECT_TRUE(torch::equal(torch::randn(5), undisturbed));
}

TEST(TorchNetwork, WeightBlocksAreTheTensors) {
  EXPECT_EQ(MakeDense(false)->WeightBlocks(), (std::vector<int>{12, 4, 8, 2}));
}

// Statistics of the batch couple its samples: J is that of the whole batch.
struct Normalized : torch::nn::Module {
  Normalized() {
    register_module("linear", linear);
    register_module("normalization", normalization);
  }
  Tensor forward(const Tensor& x) {
    return torch::tanh(normalization->forward(linear->forward(x)));
  }
  torch::nn::Linear linear{2, 3};
  torch::nn::BatchNorm1d normalization{
      torch::nn::BatchNorm1dOptions(3).track_running_stats(false)};
};

TEST(TorchNetwork, BatchNormalizationCouplesSamples) {
  std::string error;
  const auto network = Make<Normalized>(Options({2}, true), &error);
  ASSERT_NE(network, nullptr) << error;
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const MatrixXd inputs = RandomMatrix(2, 6, 2);
  EXPECT_GT((network->Outputs(weights, inputs).leftCols(3) -
             network->Outputs(weights, inputs.leftCols(3)))
                .norm(),
            1e-2);
  ExpectNetworkAdjointIdentity(*network, weights, inputs, 1e-12);
  ExpectNetworkTangentIsDifference(*network, weights, inputs, 1e-5, 1e-7);
}

// One layer under two names.
struct Tied : torch::nn::Module {
  Tied() {
    register_module("encoder", layer);
    register_module("decoder", layer);
    register_module("last", last);
  }
  Tensor forward(const Tensor& x) {
    return last->forward(torch::tanh(layer->forward(layer->forward(x))));
  }
  torch::nn::Linear layer{3, 3};
  torch::nn::Linear last{3, 2};
};

TEST(TorchNetwork, ASharedLayerIsOneBlockOfWeights) {
  std::string error;
  const auto network = Make<Tied>(Options({3}, true), &error);
  ASSERT_NE(network, nullptr) << error;
  EXPECT_EQ(network->num_weights(), 12 + 8);
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const MatrixXd inputs = RandomMatrix(3, 4, 2);
  ExpectNetworkAdjointIdentity(*network, weights, inputs, 1e-12);
  ExpectNetworkTangentIsDifference(*network, weights, inputs, 1e-5, 1e-7);
}

// Its outputs are not contiguous.
struct Transposes : torch::nn::Module {
  Transposes() { register_module("linear", linear); }
  Tensor forward(const Tensor& x) {
    return linear->forward(x).view({-1, 2, 3}).transpose(1, 2);
  }
  torch::nn::Linear linear{2, 6};
};

TEST(TorchNetwork, OutputsNeedNotBeContiguous) {
  std::string error;
  const auto network = Make<Transposes>(Options({2}, true), &error);
  ASSERT_NE(network, nullptr) << error;
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  const VectorXd input = RandomMatrix(2, 1, 2);
  // It is linear: a cost whose target are the outputs at 0 is J x.
  const TrainedNetworkCost cost(
      network, weights, network->Outputs(weights, VectorXd::Zero(2)));
  VectorXd residuals(6);
  Eigen::Matrix<double, 6, 2, Eigen::RowMajor> jacobian;
  const double* blocks[] = {input.data()};
  double* jacobians[] = {jacobian.data()};
  ASSERT_TRUE(cost.Evaluate(blocks, residuals.data(), jacobians));
  EXPECT_LT((jacobian * input - residuals).norm(), 1e-14);
}

TEST(TorchNetwork, IsMadeWhereTheProgramComputesNoGradients) {
  const torch::NoGradGuard guard;
  EXPECT_NE(MakeDense(/*double_precision=*/false), nullptr);
}

struct DropsOut : torch::nn::Module {
  DropsOut() {
    register_module("linear", linear);
    register_module("dropout", dropout);
  }
  Tensor forward(const Tensor& x) {
    return dropout->forward(linear->forward(x));
  }
  torch::nn::Linear linear{3, 64};
  torch::nn::Dropout dropout{0.5};
};
struct NoParameters : torch::nn::Module {
  Tensor forward(const Tensor& x) { return x; }
};
struct TracksStatistics : torch::nn::Module {
  TracksStatistics() { register_module("normalization", normalization); }
  Tensor forward(const Tensor& x) { return normalization->forward(x); }
  torch::nn::BatchNorm1d normalization{3};
};
struct SumsTheBatch : torch::nn::Module {
  SumsTheBatch() { register_module("linear", linear); }
  Tensor forward(const Tensor& x) { return linear->forward(x).sum(); }
  torch::nn::Linear linear{3, 2};
};
struct Detaches : torch::nn::Module {
  Detaches() { register_module("linear", linear); }
  Tensor forward(const Tensor& x) { return linear->forward(x).detach(); }
  torch::nn::Linear linear{3, 2};
};

template <typename Module>
std::string Refusal(std::vector<int64_t> shape) {
  std::string error;
  EXPECT_EQ(Make<Module>(Options(std::move(shape), false), &error), nullptr);
  return error;
}

TEST(TorchNetwork, ModulesThatDoNotFitAreRefusedWithTheReason) {
  EXPECT_EQ(Refusal<NoParameters>({3}),
            "the module has no parameters that need a gradient");
  EXPECT_EQ(
      Refusal<TracksStatistics>({3}).rfind(
          "a forward pass changes the buffer normalization.running_mean", 0),
      0u);
  EXPECT_EQ(Refusal<SumsTheBatch>({3}),
            "for an input of the shape (2, 3) the module must return a tensor "
            "of the shape (2, ...), found ()");
  EXPECT_EQ(Refusal<Detaches>({3}),
            "the output does not depend on the parameters differentiably");
  EXPECT_EQ(Refusal<DropsOut>({3}),
            "two forward passes with the same weights differ: call eval(), "
            "which switches dropout off");
  EXPECT_EQ(Refusal<Dense>({7}).rfind(
                "the module does not take an input of the shape (2, 7): ", 0),
            0u)
      << Refusal<Dense>({7});
  EXPECT_EQ(Refusal<Dense>({}),
            "the shape of a sample must have positive sizes, found ()");
  EXPECT_EQ(Refusal<Dense>({3, 0}),
            "the shape of a sample must have positive sizes, found (3, 0)");
}

}  // namespace torch_network_test
}  // namespace invgrad
