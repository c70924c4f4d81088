#include "invgrad/torch/u_net.h"

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/torch/peak_memory.h"
#include "tests/support/random_matrix.h"
#include "tests/torch/network_identities.h"

namespace invgrad {
namespace u_net_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::shared_ptr<const Network> Make(const UNetOptions& options) {
  std::string error;
  auto network = MakeUNet(options, &error);
  EXPECT_NE(network, nullptr) << error;
  return network;
}

VectorXd InitialWeights(const Network& network) {
  NumpyRandom random(0);
  return network.InitialWeights(Initialization::kPytorch, &random);
}

// The paper's counts: 37,697 weights for heat and Poisson, 49,570 for the
// fluid.
TEST(UNet, HasThePublishedNumbersOfWeights) {
  UNetOptions options;
  EXPECT_EQ(Make(options)->num_weights(), 37697);
  options.in_channels = options.out_channels = 2;
  options.levels = 5;
  EXPECT_EQ(Make(options)->num_weights(), 49570);
}

TEST(UNet, DerivativesAgree) {
  for (const bool periodic : {false, true}) {
    SCOPED_TRACE(periodic);
    UNetOptions options;
    options.rows = 8;
    options.cols = 12;
    options.levels = 3;
    options.filters = 4;
    options.periodic = periodic;
    options.double_precision = true;
    const MatrixXd inputs = RandomMatrix(96, 3, 2);
    const auto network = Make(options);
    const VectorXd weights = InitialWeights(*network);
    ExpectNetworkAdjointIdentity(*network, weights, inputs, 1e-12);
    // A short step, which crosses few kinks of ReLU and pooling.
    ExpectNetworkTangentIsDifference(*network, weights, inputs, 1e-7, 1e-4);
    options.double_precision = false;
    ExpectNetworkAdjointIdentity(*Make(options), weights, inputs, 1e-5);
  }
}

TEST(UNet, APeriodicOneCommutesWithShiftsByItsCoarsestCell) {
  UNetOptions options;
  options.rows = options.cols = 8;
  options.levels = 1;  // no pooling
  options.filters = 4;
  options.periodic = true;
  options.double_precision = true;
  const auto network = Make(options);
  const VectorXd weights = InitialWeights(*network);
  const MatrixXd inputs = RandomMatrix(64, 2, 3);
  const auto shifted = [](const MatrixXd& fields) {
    MatrixXd result(fields.rows(), fields.cols());
    for (int i = 0; i < 8; ++i) {
      for (int j = 0; j < 8; ++j) {
        result.row(8 * ((i + 3) % 8) + (j + 5) % 8) = fields.row(8 * i + j);
      }
    }
    return result;
  };
  EXPECT_LT((network->Outputs(weights, shifted(inputs)) -
             shifted(network->Outputs(weights, inputs)))
                .norm(),
            1e-12);
}

TEST(UNet, KeepsTheMean) {
  UNetOptions options;
  options.rows = options.cols = 8;
  options.levels = 2;
  options.keeps_mean = true;
  options.double_precision = true;
  const auto network = Make(options);
  const MatrixXd inputs = RandomMatrix(64, 2, 3);
  EXPECT_LT(
      (network->Outputs(InitialWeights(*network), inputs).colwise().mean() -
       inputs.colwise().mean())
          .norm(),
      1e-14);
}

TEST(UNet, AnyGridThatHasACellOnEachLevelIsAllowed) {
  UNetOptions options;
  options.rows = 9;
  options.cols = 13;
  const auto network = Make(options);
  EXPECT_TRUE(
      network->Outputs(InitialWeights(*network), RandomMatrix(117, 2, 1))
          .allFinite());
  options.rows = 7;
  std::string error;
  EXPECT_EQ(MakeUNet(options, &error), nullptr);
  EXPECT_EQ(error,
            "a U-net of 4 levels needs at least 8 cells a side, found 7 x 13");
  options.levels = 0;
  EXPECT_EQ(MakeUNet(options, &error), nullptr);
  EXPECT_EQ(error, "a U-net has 1 to 30 levels, found 0");
}

// The statement before a run is kept: bytes_per_column is measured with other
// batches than this one.
TEST(UNet, ItsMemoryIsTheStatedOne) {
  UNetOptions options;
  options.rows = options.cols = 32;
  const auto network = Make(options);
  constexpr int kBatchSize = 16;
  const VectorXd weights = InitialWeights(*network);
  const MatrixXd inputs = RandomMatrix(1024, kBatchSize, 1);
  const auto pass = network->NewPass();
  std::string error;
  VectorXd gradient;
  const PeakMemory memory;
  ASSERT_TRUE(network->Forward(
      weights, inputs, Network::Derivatives::kFirst, pass.get(), &error));
  network->Backward(weights, *pass, inputs, &gradient);
  const double stated = kBatchSize * network->bytes_per_column();
  // The statement allows for memory that tensors do not count.
  EXPECT_LT(memory.bytes(), 0.8 * stated);
  EXPECT_GT(memory.bytes(), 0.5 * stated);
}

}  // namespace u_net_test
}  // namespace invgrad
