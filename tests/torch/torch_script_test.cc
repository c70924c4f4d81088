#include <fstream>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/random.h"
#include "invgrad/torch_network.h"
#include "tests/support/random_matrix.h"
#include "tests/support/temporary_folder.h"
#include "tests/torch/network_identities.h"
#include "torch/script.h"

namespace invgrad {
namespace torch_script_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// x = tanh(a W^T) + b, or what `source` says.
constexpr char kForward[] = R"(
  def forward(self, x):
    return torch.tanh(torch.matmul(x, self.W.t())) + self.b
)";

class TorchScriptTest : public testing::Test {
 protected:
  std::string Save(const std::string& source) const {
    torch::jit::Module module("module");
    module.register_parameter(
        "W", torch::ones({2, 3}, torch::requires_grad()), /*is_buffer=*/false);
    module.register_parameter(
        "b", torch::zeros({2}, torch::requires_grad()), false);
    module.register_buffer("count", torch::zeros({1}));
    module.define(source);
    module.save(path());
    return path();
  }
  std::string path() const { return folder_ / "network.pt"; }
  std::string Refusal(const std::string& at) const {
    std::string error;
    EXPECT_EQ(LoadTorchScript(at, {3}, false, &error), nullptr);
    EXPECT_EQ(error.rfind(at + ": ", 0), 0u) << error;
    return error.substr(std::min(error.size(), at.size() + 2));
  }

  TemporaryFolder folder_;
};

TEST_F(TorchScriptTest, ComputesTheFunctionAndItsDerivatives) {
  std::string error;
  const auto network = LoadTorchScript(Save(kForward), {3}, true, &error);
  ASSERT_NE(network, nullptr) << error;
  EXPECT_EQ(network->num_inputs(), 3);
  EXPECT_EQ(network->num_outputs(), 2);
  ASSERT_EQ(network->num_weights(), 8);
  // K-FAC finds the product with W; b is a weight of no layer.
  ASSERT_EQ(FactorLayersOf(*network).size(), 1u);
  EXPECT_EQ(FactorLayersOf(*network)[0],
            Eigen::VectorXi::LinSpaced(6, 0, 5).reshaped(3, 2));
  const VectorXd weights = RandomMatrix(8, 1, 1);
  const MatrixXd inputs = RandomMatrix(3, 4, 2);
  // Row-major W, then b.
  const MatrixXd W = weights.head(6).reshaped(3, 2).transpose();
  const MatrixXd expected =
      MatrixXd((W * inputs).array().tanh()).colwise() + weights.tail(2);
  EXPECT_LT((network->Outputs(weights, inputs) - expected).norm(), 1e-14);
  ExpectNetworkAdjointIdentity(*network, weights, inputs, 1e-13);
  ExpectNetworkTangentIsDifference(*network, weights, inputs, 1e-5, 1e-8);
}

// W and b are the output layer of tanh(a), if no sum comes after the product.
TEST_F(TorchScriptTest, HasAnOutputLayer) {
  std::string error;
  const auto network = LoadTorchScript(
      Save("def forward(self, x):\n"
           "  return torch.addmm(self.b, torch.tanh(x), self.W.t())\n"),
      {3},
      true,
      &error);
  ASSERT_NE(network, nullptr) << error;
  const LayerColumns layer = OutputLayerOf(*network);
  ASSERT_EQ(layer.rows(), 4);
  ASSERT_EQ(layer.cols(), 2);
  const VectorXd weights = RandomMatrix(8, 1, 1);
  const MatrixXd inputs = RandomMatrix(3, 4, 2);
  for (int k = 0; k < 3; ++k) {  // as the interpreter warms up
    const auto pass = network->NewPass();
    ASSERT_TRUE(network->Forward(
        weights, inputs, Network::Derivatives::kFirst, pass.get(), &error))
        << error;
    const MatrixXd h = FeaturesOf(*network, weights, *pass);
    ASSERT_EQ(h.rows(), 4);
    EXPECT_LT((h.topRows(3) - inputs.array().tanh().matrix()).norm(), 1e-14);
    EXPECT_LT((weights(layer.reshaped()).reshaped(4, 2).transpose() * h -
               pass->outputs)
                  .norm(),
              1e-14);
  }
  EXPECT_EQ(
      OutputLayerOf(*LoadTorchScript(Save(kForward), {3}, true, &error)).size(),
      0);
}

TEST_F(TorchScriptTest, InitialWeightsAreThoseOfTheFile) {
  std::string error;
  const auto network = LoadTorchScript(Save(kForward), {3}, false, &error);
  ASSERT_NE(network, nullptr) << error;
  NumpyRandom random(7);
  VectorXd expected = VectorXd::Ones(8);
  expected.tail(2).setZero();
  network->Outputs(RandomMatrix(8, 1, 1), RandomMatrix(3, 4, 2));
  EXPECT_EQ(network->InitialWeights(Initialization::kHeUniform, &random),
            expected);
}

TEST_F(TorchScriptTest, FilesThatAreNoneAreRefused) {
  EXPECT_EQ(Refusal(folder_ / "none.pt"), "there is no such file");
  EXPECT_EQ(Refusal(folder_ / "."), "there is no such file");
  std::ofstream(path()) << "not a zip archive";
  EXPECT_EQ(Refusal(path()).rfind("not a TorchScript file", 0), 0u);
}

TEST_F(TorchScriptTest, ModulesThatDoNotFitAreRefused) {
  EXPECT_EQ(Refusal(Save("def forward(self, x):\n  return x.double()\n")),
            "the module must return values of the type Float, found Double");
  EXPECT_EQ(Refusal(Save("def forward(self, x):\n"
                         "  self.count.add_(1)\n"
                         "  return x * self.b.sum()\n"))
                .rfind("a forward pass changes the buffer count", 0),
            0u);
  EXPECT_EQ(
      Refusal(Save("def forward(self, x):\n"
                   "  return torch.matmul(x, self.W)\n"))
          .rfind("the module does not take an input of the shape (2, 3)", 0),
      0u);
}

}  // namespace torch_script_test
}  // namespace invgrad
