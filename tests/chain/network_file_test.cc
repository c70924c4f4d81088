#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/random.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace network_file_test {

using Eigen::VectorXd;

bool SameBits(const VectorXd& a, const VectorXd& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

class NetworkFile : public ::testing::Test {
 protected:
  // What ReadNetwork says of a file of that text. It must refuse it, and leave
  // the weights alone.
  std::string Refusal(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    std::string error;
    VectorXd weights = VectorXd::Constant(1, 7.0);
    EXPECT_FALSE(ReadNetwork(path_, &weights, &error).has_value()) << text;
    EXPECT_TRUE(weights.size() == 1 && weights[0] == 7.0);
    EXPECT_EQ(error.find("file " + path_ + ": "), 0u) << error;
    return error;
  }

  std::string Text() const {
    std::string text;
    std::string error;
    EXPECT_TRUE(ReadFile(path_, &text, &error)) << error;
    return text;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "network.txt";
};

TEST_F(NetworkFile, IsTheTextOfItsHeader) {
  std::string error;
  VectorXd weights(5);
  weights << 0.1, -2.0, 1e-300, 0.0, 12345678.5;
  ASSERT_TRUE(WriteNetwork(path_,
                           DenseNetwork({1, 1, 1}, Activation::kTanh),
                           weights.head(4),
                           &error))
      << error;
  EXPECT_EQ(Text(),
            "invgrad network 1\nwidths 1 1 1\nactivation tanh\nweights 4\n"
            "0.1\n-2\n1e-300\n0\n");
  EXPECT_EQ(folder_.NumFiles(), 1);
  EXPECT_DEATH(
      WriteNetwork(
          path_, DenseNetwork({1, 1, 1}, Activation::kTanh), weights, &error),
      "num_weights");
}

TEST_F(NetworkFile, RoundTripIsBitForBit) {
  NumpyRandom random(1);
  for (const Activation activation : kActivations) {
    for (const std::vector<int>& widths :
         {std::vector<int>{1, 1}, {4, 20, 20, 20, 24}, {3, 1, 7}}) {
      const DenseNetwork network(widths, activation);
      VectorXd weights =
          network.InitialWeights(Initialization::kPytorch, &random);
      weights[0] = -0.0;
      weights[1] = std::numeric_limits<double>::denorm_min();
      std::string error;
      ASSERT_TRUE(WriteNetwork(path_, network, weights, &error)) << error;
      VectorXd read;
      const std::optional<DenseNetwork> same =
          ReadNetwork(path_, &read, &error);
      ASSERT_TRUE(same.has_value()) << error;
      EXPECT_EQ(same->widths(), widths);
      EXPECT_EQ(same->hidden_activation(), activation);
      EXPECT_TRUE(SameBits(read, weights)) << network.Name();
    }
  }
}

TEST_F(NetworkFile, RoundTripOfExtremeWeights) {
  const DenseNetwork network({1, 2}, Activation::kLinear);
  VectorXd weights(4);
  weights << std::numeric_limits<double>::max(),
      std::numeric_limits<double>::lowest(), std::numeric_limits<double>::min(),
      1.0 + 2.3e-16;
  std::string error;
  ASSERT_TRUE(WriteNetwork(path_, network, weights, &error)) << error;
  VectorXd read;
  ASSERT_TRUE(ReadNetwork(path_, &read, &error).has_value()) << error;
  EXPECT_TRUE(SameBits(read, weights));
}

// Wherever a file ends early, even within its last number.
TEST_F(NetworkFile, EveryTruncationIsRefused) {
  const DenseNetwork network({2, 3, 1}, Activation::kRelu);
  NumpyRandom random(1);
  std::string error;
  ASSERT_TRUE(
      WriteNetwork(path_,
                   network,
                   network.InitialWeights(Initialization::kHeUniform, &random),
                   &error))
      << error;
  const std::string text = Text();
  for (size_t size = 0; size < text.size(); ++size) {
    Refusal(text.substr(0, size));
  }
  EXPECT_NE(Refusal(text.substr(0, text.size() - 1)).find("weight 13 of 13"),
            std::string::npos);
  EXPECT_NE(Refusal(text + "1\n").find("goes on"), std::string::npos);
}

TEST_F(NetworkFile, SaysWhatIsWrong) {
  const std::string begin = "invgrad network 1\n";
  const auto expect = [this](const std::string& text, const std::string& what) {
    const std::string error = Refusal(text);
    EXPECT_NE(error.find(what), std::string::npos) << error;
  };
  expect("\x93NUMPY", "not a network");
  expect("invgrad network 2\nwidths 1 1\n", "not a network");
  expect(begin + "width 1 1\n", "line 2");
  for (const char* widths : {"",
                             " ",
                             " 1",
                             " 1 0",
                             " 1 -1",
                             " 1  1",
                             " 1 1 ",
                             " 1 x",
                             " 1 1.5",
                             " 99999999999 1"}) {
    expect(begin + "widths" + widths + "\nactivation tanh\nweights 2\n1\n1\n",
           "line 2");
  }
  expect(begin + "widths 1 1\nactivation sine\nweights 2\n1\n1\n",
         "one of linear tanh relu sigmoid gelu");
  expect(begin + "widths 1 1\nactivation tanh\nweights 3\n1\n1\n1\n",
         "'weights 2'");
  expect(begin + "widths 1 1\nactivation tanh\nweights 2\n1\nnan\n",
         "line 6 is not a finite number: 'nan'");
  expect(begin + "widths 1 1\nactivation tanh\nweights 2\ninf\n1\n", "line 5");
  expect(begin + "widths 1 1\nactivation tanh\nweights 2\n1e999\n1\n",
         "line 5");
  expect(begin + "widths 1 1\nactivation tanh\nweights 2\n1 \n1\n", "line 5");
  expect(begin + "widths 1 1\nactivation tanh\nweights 2\n1\n\x01" +
             std::string(1000, 'x') + "\n",
         "'\\x01xxx");
}

// Of a few bytes that ask for gigabytes nothing is allocated.
TEST_F(NetworkFile, SizesThatTheFileDoesNotHoldAreRefused) {
  const std::string begin = "invgrad network 1\nwidths ";
  EXPECT_NE(Refusal(begin + "46339 46340\nactivation tanh\nweights "
                            "2147395600\n1\n")
                .find("too short for 2147395600 weights"),
            std::string::npos);
  EXPECT_NE(Refusal(begin + "2147483647 2147483647\nactivation tanh\nweights "
                            "1\n1\n")
                .find("more than 2147483647 weights"),
            std::string::npos);
}

// What diverged training leaves can be looked at, but not be used.
TEST_F(NetworkFile, WeightsThatAreNotFiniteAreWrittenAndRefused) {
  const DenseNetwork network({1, 1}, Activation::kTanh);
  VectorXd weights(2);
  weights << std::numeric_limits<double>::quiet_NaN(),
      -std::numeric_limits<double>::infinity();
  std::string error;
  ASSERT_TRUE(WriteNetwork(path_, network, weights, &error)) << error;
  EXPECT_NE(Refusal(Text()).find("not a finite number: 'nan'"),
            std::string::npos);
}

TEST_F(NetworkFile, FilesThatAreNotThereAreNamed) {
  VectorXd weights;
  std::string error;
  EXPECT_FALSE(ReadNetwork(folder_ / "none", &weights, &error).has_value());
  EXPECT_NE(error.find("none"), std::string::npos) << error;
  EXPECT_FALSE(WriteNetwork(folder_ / "no/folder",
                            DenseNetwork({1, 1}, Activation::kTanh),
                            VectorXd::Zero(2),
                            &error));
  EXPECT_NE(error.find("no/folder"), std::string::npos) << error;
}

TEST(CountWeights, IsTheNumberOfWeights) {
  EXPECT_EQ(DenseNetwork::CountWeights({4, 20, 20, 20, 24}), 1444.0);
  const int large = std::numeric_limits<int>::max();
  EXPECT_EQ(DenseNetwork::CountWeights({large, large}), (large + 1.0) * large);
  EXPECT_DEATH(DenseNetwork({large, large}, Activation::kTanh), "CountWeights");
}

}  // namespace network_file_test
}  // namespace invgrad
