#include "invgrad/trial_function.h"

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "tests/support/derivatives_by_functor.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace trial_function_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::shared_ptr<const DerivativeSet> Set(std::vector<std::string> words) {
  return std::make_shared<DerivativeSet>("tx", std::move(words));
}

// Every operation, of two coordinates.
struct Operations {
  template <typename T>
  void operator()(const T* a, T* f) const {
    f[0] = a[0] * a[1] - 2.0 * a[0] + 1.0;
    f[1] = (a[0] + 0.5) / (1.5 - a[1]);
    f[2] = exp(a[0] * a[1]);
    f[3] = log(2.0 + a[0]);
    f[4] = sin(3.0 * a[1]) - cos(a[0]);
    f[5] = tanh(a[0] - a[1]);
    f[6] = sqrt(3.0 + a[0] * a[1]);
    f[7] = 0.25;
    f[8] = -a[1];
    f[8] += a[0];
  }
};

TEST(InputJet, DerivativesAreThoseOfDualNumbers) {
  const auto set = Set({"t", "x", "xx", "tx", "ttxx", "xxxx"});
  const MatrixXd points = RandomMatrix(2, 5, 1);
  const MatrixXd jets = JetsOf(*set, 9, Operations(), points);
  for (int s = 0; s < 5; ++s) {
    const MatrixXd expected =
        JetsByDuals(*set, "tx", 9, points.col(s), Operations());
    EXPECT_LT((jets.col(s).reshaped(9, set->num_channels()) - expected).norm(),
              kRounding * expected.norm());
  }
}

TEST(InputJet, APowerOfZeroHasDerivatives) {
  const auto set = Set({"xxx"});
  const MatrixXd jets = JetsOf(
      *set,
      1,
      [](const InputJet* a, InputJet* f) { f[0] = pow(a[1], 3.0); },
      MatrixXd::Zero(2, 1));
  EXPECT_EQ(jets(set->ChannelOf(""), 0), 0.0);
  EXPECT_EQ(jets(set->ChannelOf("x"), 0), 0.0);
  EXPECT_EQ(jets(set->ChannelOf("xx"), 0), 0.0);
  EXPECT_EQ(jets(set->ChannelOf("xxx"), 0), 6.0);
}

// Periodic in x, u = v = sin(pi x) at t = 0, v_t = 0 there.
TrialFunction Periodic(std::vector<std::string> words) {
  TrialFunction trial;
  trial.derivatives = Set(std::move(words));
  trial.num_functions = 2;
  trial.features = {3, [](const InputJet* a, InputJet* f) {
                      f[0] = a[0];
                      f[1] = sin(M_PI * a[1]);
                      f[2] = cos(M_PI * a[1]);
                    }};
  trial.boundary_values = [](const InputJet* a, InputJet* g) {
    g[0] = g[1] = sin(M_PI * a[1]);
  };
  trial.distance = [](const InputJet* a, InputJet* d) {
    d[0] = a[0];
    d[1] = a[0] * a[0];
  };
  return trial;
}

// The jets of u at points: 2 T x N.
MatrixXd ValuesAt(const TrialFunction& trial, const MatrixXd& points) {
  const DenseNetwork network({3, 6, 5, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 2);
  const int T = trial.derivatives->num_channels();
  MatrixXd inputs, conditions;
  std::string error;
  EXPECT_TRUE(trial.Inputs(points, &inputs, &error)) << error;
  EXPECT_TRUE(trial.Conditions(points, &conditions, &error)) << error;
  DenseNetwork::Activations pass;
  network.ForwardJets(weights,
                      trial.derivatives,
                      inputs.reshaped(3, points.cols() * T),
                      false,
                      &pass);
  return trial.Values(pass.outputs.reshaped(2 * T, points.cols()), conditions);
}

TEST(TrialFunction, SatisfiesItsConditionsForAnyWeights) {
  const TrialFunction trial = Periodic({"t", "x", "xx"});
  MatrixXd points(2, 4);
  points << 0.0, 0.0, 0.7, 0.7, 0.3, -0.8, -1.0, 1.0;
  const MatrixXd u = ValuesAt(trial, points);
  for (int s = 0; s < 2; ++s) {
    const double angle = M_PI * points(1, s);
    EXPECT_NEAR(u(0, s), std::sin(angle), 1e-15);
    EXPECT_NEAR(u(1, s), std::sin(angle), 1e-15);
    const int t = 2 * trial.derivatives->ChannelOf("t");
    EXPECT_GT(std::abs(u(t, s)), 1e-3);
    EXPECT_EQ(u(t + 1, s), 0.0);
    const int xx = 2 * trial.derivatives->ChannelOf("xx");
    EXPECT_NEAR(u(xx, s), -M_PI * M_PI * std::sin(angle), 1e-14);
  }
  // All derivatives are periodic.
  EXPECT_LT((u.col(2) - u.col(3)).norm(), 1e-12);
}

TEST(TrialFunction, IsZeroWhereTheDistanceIsWithoutBoundaryValues) {
  const MatrixXd points = RandomMatrix(2, 4, 3);
  TrialFunction zero = Periodic({"t", "xx"});
  zero.boundary_values = [](const InputJet*, InputJet* g) {
    g[0] = g[1] = 0.0;
  };
  TrialFunction none = zero;
  none.boundary_values = nullptr;
  EXPECT_EQ(ValuesAt(none, points), ValuesAt(zero, points));
  // As a function of jets.
  const DenseNetwork network({3, 6, 5, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 2);
  const InputFunction u = [&](const InputJet* a, InputJet* values) {
    EvaluateTrialFunction(none, network, weights, a, values);
  };
  EXPECT_LT(
      (JetsOf(*none.derivatives, 2, u, points) - ValuesAt(zero, points)).norm(),
      kRounding);
}

TEST(TrialFunction, DerivativesAreDifferencesOfItsValues) {
  const TrialFunction trial = Periodic({"t", "x", "xx", "xt"});
  constexpr double h = 1e-4;
  const MatrixXd center = RandomMatrix(2, 3, 4);
  const auto shifted = [&](double dt, double dx) {
    MatrixXd points = center;
    points.row(0).array() += dt;
    points.row(1).array() += dx;
    return ValuesAt(trial, points);
  };
  const auto derivative = [&](const std::string& word) -> MatrixXd {
    return shifted(0.0, 0.0).middleRows(2 * trial.derivatives->ChannelOf(word),
                                        2);
  };
  const auto value = [&](double dt, double dx) -> MatrixXd {
    return shifted(dt, dx).topRows(2);
  };
  // h^2 times fourth derivatives of some hundreds.
  constexpr double kDifference = 2e-5;
  const auto expect_near = [&](const MatrixXd& a, const MatrixXd& b) {
    EXPECT_LT((a - b).cwiseAbs().maxCoeff(), kDifference);
  };
  expect_near(derivative("t"), (value(h, 0) - value(-h, 0)) / (2 * h));
  expect_near(derivative("x"), (value(0, h) - value(0, -h)) / (2 * h));
  expect_near(derivative("xx"),
              (value(0, h) - 2 * value(0, 0) + value(0, -h)) / (h * h));
  expect_near(derivative("tx"),
              (value(h, h) - value(-h, h) - value(h, -h) + value(-h, -h)) /
                  (4 * h * h));
}

TEST(TrialFunction, NamesPointAndDerivativeOutsideADomain) {
  TrialFunction trial;
  trial.derivatives = Set({"x"});
  trial.features = {1,
                    [](const InputJet* a, InputJet* f) { f[0] = sqrt(a[1]); }};
  trial.boundary_values = [](const InputJet* a, InputJet* g) {
    g[0] = log(a[0]);
  };
  trial.distance = [](const InputJet* a, InputJet* d) { d[0] = a[0]; };
  MatrixXd points(2, 2), jets;
  points << 1.0, -1.0, 0.5, 0.0;
  std::string error;
  EXPECT_FALSE(trial.Inputs(points, &jets, &error));
  EXPECT_EQ(error,
            "feature 0: its derivative x is not finite at point 1, (-1, 0)");
  EXPECT_FALSE(trial.Conditions(points, &jets, &error));
  EXPECT_EQ(error,
            "boundary value 0: its value is not finite at point 1, (-1, 0)");
}

// At a point that depends on others: u(begin, x) has no derivative in t.
TEST(TrialFunction, IsAFunctionOfJets) {
  const TrialFunction trial = Periodic({"t", "x", "xx"});
  const DenseNetwork network({3, 6, 5, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 2);
  const MatrixXd points = RandomMatrix(2, 4, 3);
  const auto u_at = [&](auto shift) {
    return JetsOf(
        *trial.derivatives,
        2,
        [&](const InputJet* a, InputJet* u) {
          const InputJet at[] = {shift(a[0]), a[1]};
          EvaluateTrialFunction(trial, network, weights, at, u);
        },
        points);
  };
  EXPECT_LT(
      (u_at([](const InputJet& t) { return t; }) - ValuesAt(trial, points))
          .norm(),
      kRounding);
  MatrixXd at_begin = points;
  at_begin.row(0).setConstant(0.3);
  MatrixXd expected = ValuesAt(trial, at_begin);
  expected.middleRows(2 * trial.derivatives->ChannelOf("t"), 2).setZero();
  EXPECT_LT(
      (u_at([](const InputJet&) { return InputJet(0.3); }) - expected).norm(),
      kRounding);
}

// With derivatives of its own: more of them, others, and in another order.
TEST(TrialFunction, HasTheDerivativesOfThePoint) {
  const TrialFunction trial = Periodic({"t", "xx"});
  const DenseNetwork network({3, 6, 5, 2}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 2);
  const MatrixXd points = RandomMatrix(2, 4, 3);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"x"}, {"x", "t"}, {"xx", "t", "x", "tx"}}) {
    const auto set = Set(words);
    const auto jets_by = [&](const TrialFunction& of) {
      return JetsOf(
          *set,
          2,
          [&](const InputJet* a, InputJet* u) {
            EvaluateTrialFunction(of, network, weights, a, u);
          },
          points);
    };
    EXPECT_LT((jets_by(trial) - jets_by(Periodic(words))).norm(), kRounding);
  }
}

TEST(InputJetDeathTest, RefusesJetsWithOtherDerivatives) {
  const auto a = Set({"t", "x"});
  const auto b = Set({"x", "t"});
  const auto same = Set({"t", "x"});
  const InputJet jet(a.get(), Eigen::RowVector3d(1.0, 2.0, 3.0));
  const InputJet equal(same.get(), Eigen::RowVector3d(1.0, 2.0, 3.0));
  const InputJet other(b.get(), Eigen::RowVector3d(1.0, 2.0, 3.0));
  EXPECT_EQ((jet + equal).jet(), Eigen::RowVector3d(2.0, 4.0, 6.0));
  EXPECT_DEATH(jet + other, "Jets with other derivatives");
  EXPECT_DEATH(jet * other, "Jets with other derivatives");
}

TEST(InputJet, ErfcHasItsDerivatives) {
  const auto set = Set({"xxxx"});
  const auto at = [&](double x) {
    return JetsOf(
        *set,
        1,
        [](const InputJet* a, InputJet* f) { f[0] = erfc(a[1]); },
        Eigen::Vector2d(0.0, x));
  };
  constexpr double h = 1e-3;
  const double x = 0.7;
  EXPECT_EQ(at(x)(0), std::erfc(x));
  for (const std::string word : {"x", "xx", "xxx", "xxxx"}) {
    const int k = set->ChannelOf(word);
    const int below = set->ChannelOf(word.substr(1));
    // h^2 / 6 times a third derivative of some tens.
    EXPECT_NEAR(at(x)(k), (at(x + h)(below) - at(x - h)(below)) / (2 * h), 1e-5)
        << word;
  }
}

}  // namespace trial_function_test
}  // namespace invgrad
