#include "invgrad/derivative_set.h"

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "tests/support/derivatives_by_functor.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace derivative_set_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

struct Case {
  std::string name;
  std::string variables;
  std::vector<std::string> words;
  int num_channels;  // T, counted by hand
};
const Case kCases[] = {
    {"Values", "x", {}, 1},
    {"Gradient", "xy", {"x", "y"}, 3},
    {"Burgers", "tx", {"t", "x", "xx"}, 4},
    {"Laplacian", "xy", {"xx+yy"}, 4},
    {"Heat", "txyz", {"t", "xx+yy+zz"}, 6},
    {"KortewegDeVries", "tx", {"t", "x", "xxx"}, 5},
    {"Wave", "tx", {"tt", "xx"}, 5},
    {"Kuramoto", "tx", {"xxxx", "t", "xx", "x"}, 6},
    {"Mixed", "xyt", {"xxy", "yt", "xx+tt"}, 9},
    {"Biharmonic", "xy", {"xxxx", "xxyy", "yyyy"}, 13},
};

class DerivativeSetTest : public testing::TestWithParam<Case> {
 protected:
  const DerivativeSet set_{GetParam().variables, GetParam().words};
  const int d_ = set_.num_variables();
  const int T_ = set_.num_channels();
};

TEST_P(DerivativeSetTest, ChannelsAreTheWordsAndWhatTheyNeed) {
  EXPECT_EQ(T_, GetParam().num_channels);
  EXPECT_EQ(set_.num_stated(), 1 + static_cast<int>(GetParam().words.size()));
  EXPECT_EQ(set_.ChannelOf(""), 0);
  for (int k = 1; k < set_.num_stated(); ++k) {
    EXPECT_EQ(set_.word(k), GetParam().words[k - 1]);
  }
  for (int k = 0; k < T_; ++k) EXPECT_EQ(set_.ChannelOf(set_.word(k)), k);
}

TEST_P(DerivativeSetTest, NetworkJetsAreThoseOfDualNumbers) {
  const auto set = std::make_shared<DerivativeSet>(set_);
  for (const Activation activation : kSmoothActivations) {
    const DenseNetwork network({d_, 5, 4, 3}, activation);
    const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
    const MatrixXd points = RandomMatrix(d_, 3, 2);
    DenseNetwork::Activations jets;
    network.ForwardJets(weights,
                        set,
                        set_.InputJets(points).reshaped(d_, 3 * T_),
                        false,
                        &jets);
    ASSERT_EQ(jets.outputs.cols(), 3 * T_);
    for (int s = 0; s < 3; ++s) {
      const MatrixXd expected = JetsByFunctor(
          set_, GetParam().variables, network, weights, points.col(s));
      EXPECT_LT((jets.outputs.middleCols(T_ * s, T_) - expected).norm(),
                kRounding * (1.0 + expected.norm()))
          << network.Name();
    }
  }
}

// The product of two functions.
TEST_P(DerivativeSetTest, MultipliesAsFunctionsDo) {
  const VectorXd point = RandomMatrix(d_, 1, 3);
  const MatrixXd jets = JetsByDuals(
      set_, GetParam().variables, 3, point, [&](const Dual4* a, Dual4* values) {
        Dual4 sum(0.3);
        for (int i = 0; i < d_; ++i) sum += Dual4(1.0 + i) * a[i];
        values[0] = sin(sum);
        values[1] = exp(a[0] * a[d_ - 1]);
        values[2] = values[0] * values[1];
      });
  MatrixXd product = jets.row(1);
  set_.Multiply(jets.row(0), product);
  EXPECT_LT((product - jets.row(2)).norm(), kRounding * jets.norm());
  product = jets.row(0);  // symmetric
  set_.Multiply(jets.row(1), product);
  EXPECT_LT((product - jets.row(2)).norm(), kRounding * jets.norm());
}

TEST_P(DerivativeSetTest, TransposedIsTheAdjoint) {
  const MatrixXd factors = RandomMatrix(3, 2 * T_, 1);
  const MatrixXd v = RandomMatrix(3, 2 * T_, 2);
  const MatrixXd w = RandomMatrix(3, 2 * T_, 3);
  MatrixXd Jv = v;
  MatrixXd Jtw = w;
  set_.Multiply(factors, Jv);
  set_.MultiplyTransposed(factors, Jtw);
  EXPECT_NEAR(Jv.cwiseProduct(w).sum(), Jtw.cwiseProduct(v).sum(), kRounding);
}

TEST_P(DerivativeSetTest, ComposesAsFunctionsDo) {
  const VectorXd point = RandomMatrix(d_, 1, 3);
  const MatrixXd jets = JetsByDuals(
      set_, GetParam().variables, 2, point, [&](const Dual4* a, Dual4* values) {
        values[0] = a[0] * a[0] * a[d_ - 1] - Dual4(0.5) * a[d_ - 1];
        values[1] = exp(values[0]);
      });
  const VectorXd z = jets.row(0);
  const VectorXd derivatives = VectorXd::Constant(5, std::exp(z[0]));
  VectorXd result(T_);
  set_.Compose(derivatives.data(), z.data(), result.data());
  EXPECT_LT((result.transpose() - jets.row(1)).norm(), kRounding);
}

INSTANTIATE_TEST_SUITE_P(Sets,
                         DerivativeSetTest,
                         testing::ValuesIn(kCases),
                         [](const auto& info) { return info.param.name; });

TEST(ActivateAll, HigherDerivativesAreThoseOfLowerOnes) {
  constexpr double h = 1e-5;
  for (const Activation activation : kSmoothActivations) {
    for (const double at : {-3.0, -0.8, 0.0, 0.3, 2.5}) {
      double z[] = {at - h, at, at + h};
      double d[kMaxActivationOrder][3];
      ActivateAll(activation, 3, z, kMaxActivationOrder, d[0]);
      EXPECT_NEAR(d[0][1], (z[2] - z[0]) / (2.0 * h), 2e-9);
      for (int p = 1; p < kMaxActivationOrder; ++p) {
        // h^2 / 6 times a derivative of at most 4,000, and eps / h.
        EXPECT_NEAR(d[p][1], (d[p - 1][2] - d[p - 1][0]) / (2.0 * h), 1e-7)
            << ActivationName(activation) << " at " << at << ", order "
            << p + 1;
      }
    }
  }
}

// f = 2 tanh(z) + 0.25, z = 0.3 t - 1.1 x + 0.4.
TEST(ForwardJets, OfOneNeuronIsTheClosedForm) {
  const DenseNetwork network({2, 1, 1}, Activation::kTanh);
  VectorXd weights(5);
  weights << 0.3, -1.1, 0.4, 2.0, 0.25;
  const Vector2d a(0.6, 0.9);
  const auto set = std::make_shared<DerivativeSet>(
      "tx", std::vector<std::string>{"xxx", "t"});
  DenseNetwork::Activations activations;
  network.ForwardJets(weights,
                      set,
                      set->InputJets(a).reshaped(2, set->num_channels()),
                      false,
                      &activations);
  const double t = std::tanh(0.3 * a[0] - 1.1 * a[1] + 0.4);
  const double s = 1.0 - t * t;
  EXPECT_NEAR(activations.outputs(0), 2.0 * t + 0.25, 1e-14);
  EXPECT_NEAR(activations.outputs(1),
              2.0 * s * (6.0 * t * t - 2.0) * std::pow(-1.1, 3),
              1e-14);
  EXPECT_NEAR(activations.outputs(2), 2.0 * s * 0.3, 1e-14);
}

TEST(DerivativeSet, WordsMayBeSpelledInAnyOrder) {
  const DerivativeSet set("tx", {"txx", "xx+tt"});
  EXPECT_EQ(set.ChannelOf("xtx"), 1);
  EXPECT_EQ(set.ChannelOf("tt+xx"), 2);
}

TEST(DerivativeSetDeathTest, NamesWhatItDoesNotUnderstand) {
  using Words = std::vector<std::string>;
  EXPECT_DEATH(DerivativeSet("tx", Words{"xy"}),
               "The derivative xy: y is not one of the variables \"tx\". The "
               "word for u_tt is tt.");
  EXPECT_DEATH(DerivativeSet("tx", Words{"xxxxx"}),
               "The derivative xxxxx is of an order above 4");
  EXPECT_DEATH(DerivativeSet("tx", Words{"t+xx"}), "not a sum of second");
  EXPECT_DEATH(DerivativeSet("tx", Words{"xx+"}), "not a sum of second");
  EXPECT_DEATH(DerivativeSet("tx", Words{"xx+xx"}), "a variable twice");
  EXPECT_DEATH(DerivativeSet("tx", Words{"tx", "xt"}), "stated twice");
  EXPECT_DEATH(DerivativeSet("tx", Words{""}), "The value is channel 0");
  EXPECT_DEATH(DerivativeSet("tt", Words{}), "a different letter each");
  EXPECT_DEATH(DerivativeSet("tx", Words{"t"}).ChannelOf("x"),
               "The derivative x is not in the set");
}

TEST(ForwardJetsDeathTest, RefusesSecondDerivativesOfRelu) {
  const DenseNetwork network({2, 3, 1}, Activation::kRelu);
  const auto set =
      std::make_shared<DerivativeSet>("xy", std::vector<std::string>{"xx"});
  DenseNetwork::Activations activations;
  EXPECT_DEATH(network.ForwardJets(VectorXd::Zero(network.num_weights()),
                                   set,
                                   MatrixXd::Zero(2, set->num_channels()),
                                   false,
                                   &activations),
               "ReLU has no second derivative");
}

}  // namespace derivative_set_test
}  // namespace invgrad
