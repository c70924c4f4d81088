// The error bars of docs/examples/error_bars.h are those of Bayesian linear
// regression where the model is linear.

#include "docs/examples/error_bars.h"

#include <cmath>
#include <memory>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/simulator.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace error_bars_test {

using namespace error_bars;  // NOLINT: what is tested

void ExpectNearRelative(double value, double expected, double tolerance) {
  EXPECT_NEAR(value, expected, tolerance * std::abs(expected));
}

// C as it is defined, at the scales of the bars.
MatrixXd CovarianceOf(const MatrixXd& J,
                      const VectorXd& initial_variance,
                      const ErrorBars& bars) {
  MatrixXd precision = J.transpose() * J / bars.noise_variance();
  precision.diagonal() +=
      (bars.prior_scale() * initial_variance).cwiseInverse();
  return precision.inverse();
}

// More rows than weights, and fewer.
TEST(ErrorBars, AreThoseOfBayesianLinearRegression) {
  for (const int m : {30, 4}) {
    for (const Prior prior : {Prior::kInitial, Prior::kEvidence}) {
      SCOPED_TRACE(m);
      const MatrixXd J = RandomMatrix(m, 7, 1);
      const VectorXd r = 0.1 * RandomMatrix(m, 1, 2);
      const VectorXd w = 3.0 * RandomMatrix(7, 1, 3);
      const VectorXd initial_variance = VectorXd::LinSpaced(7, 0.1, 3.0);
      const MatrixXd J_f = RandomMatrix(5, 7, 4);
      const ErrorBars bars(J, r, w, initial_variance, prior);
      const MatrixXd C = CovarianceOf(J, initial_variance, bars);
      const VectorXd expected =
          (J_f * C * J_f.transpose()).diagonal().cwiseSqrt();
      EXPECT_LT((bars.Deviations(J_f) - expected).norm(),
                1e-9 * expected.norm());
      // The equations for the scales.
      const double gamma =
          (J * C * J.transpose()).trace() / bars.noise_variance();
      ExpectNearRelative(bars.num_determined(), gamma, 1e-9);
      ExpectNearRelative(
          bars.noise_variance() * (m - gamma), r.squaredNorm(), 1e-9);
      const double size = w.cwiseAbs2().cwiseQuotient(initial_variance).sum();
      ExpectNearRelative(bars.prior_scale(),
                         prior == Prior::kInitial ? 1.0 : size / gamma,
                         1e-9);
    }
  }
}

// The textbook's variance of the mean response:
//   s^2 (1 / N + (x - mean x)^2 / sum (x_i - mean x)^2),  s^2 = RSS / (N - 2)
TEST(ErrorBars, OfALineWithAWidePrior) {
  const VectorXd x = VectorXd::LinSpaced(9, -1.0, 3.0);
  VectorXd y(9);
  y << 1.1, 0.8, 1.4, 1.9, 1.6, 2.2, 2.9, 2.4, 3.1;
  MatrixXd J(9, 2);
  J << x, VectorXd::Ones(9);
  const VectorXd w = (J.transpose() * J).inverse() * (J.transpose() * y);
  const VectorXd r = J * w - y;
  const ErrorBars bars(J, r, w, VectorXd::Constant(2, 1e6), Prior::kInitial);
  EXPECT_NEAR(bars.noise_variance(), r.squaredNorm() / 7.0, 1e-6);
  const double mean = x.mean();
  const double sum = (x.array() - mean).square().sum();
  for (const double at : {-4.0, 1.0, 2.5}) {
    const MatrixXd J_f = Eigen::RowVector2d(at, 1.0);
    const double expected = std::sqrt(
        r.squaredNorm() / 7.0 * (1.0 / 9.0 + (at - mean) * (at - mean) / sum));
    EXPECT_NEAR(bars.Deviations(J_f)[0], expected, 1e-6 * expected);
  }
}

TEST(ErrorBars, AreThePriorWhereTheDataSayNothing) {
  MatrixXd J = RandomMatrix(20, 5, 4);
  J.rightCols(2).setZero();
  const VectorXd prior = VectorXd::LinSpaced(5, 0.5, 2.5);
  const VectorXd r = RandomMatrix(20, 1, 5);
  const ErrorBars bars(J, r, prior, prior, Prior::kInitial);
  const MatrixXd J_f = MatrixXd::Identity(5, 5);
  const VectorXd deviations = bars.Deviations(J_f);
  EXPECT_NEAR(deviations[3], std::sqrt(prior[3]), 1e-12);
  EXPECT_NEAR(deviations[4], std::sqrt(prior[4]), 1e-12);
  EXPECT_LT(deviations[0], 0.9 * std::sqrt(prior[0]));
}

TEST(ErrorBars, DoNotDependOnTheUnitsOfTheOutputs) {
  const MatrixXd J_f = RandomMatrix(3, 6, 7);
  for (const int m : {20, 4}) {
    const MatrixXd J = RandomMatrix(m, 6, 8);
    const VectorXd r = RandomMatrix(m, 1, 9);
    const VectorXd w = RandomMatrix(6, 1, 13);
    const VectorXd ones = VectorXd::Ones(6);
    const ErrorBars bars(J, r, w, ones, Prior::kEvidence);
    const ErrorBars in_millimetres(1e3 * J, 1e3 * r, w, ones, Prior::kEvidence);
    EXPECT_NEAR(
        in_millimetres.noise_variance() / bars.noise_variance(), 1e6, 1e-2);
    EXPECT_LT((in_millimetres.Deviations(J_f) - bars.Deviations(J_f)).norm(),
              1e-9);
  }
}

// Of 500 regressions, each with its own weights from the prior and its own
// noise.
TEST(ErrorBars, CoverTwoThirdsOfTheErrorsOfALinearModel) {
  constexpr int kNumRuns = 500;
  const MatrixXd J = RandomMatrix(40, 10, 10);
  const MatrixXd J_f = RandomMatrix(20, 10, 11);
  const VectorXd prior = VectorXd::Ones(10);
  NumpyRandom random(12);
  double covered = 0.0, covered_twice = 0.0;
  for (int run = 0; run < kNumRuns; ++run) {
    const VectorXd truth = random.Normal(10);
    const VectorXd y = J * truth + 0.5 * random.Normal(40);
    const VectorXd w = (J.transpose() * J).inverse() * (J.transpose() * y);
    const VectorXd deviations =
        ErrorBars(J, J * w - y, w, prior, Prior::kInitial).Deviations(J_f);
    const auto errors = (J_f * (w - truth)).array().abs();
    covered += (errors <= deviations.array()).cast<double>().mean();
    covered_twice += (errors <= 2.0 * deviations.array()).cast<double>().mean();
  }
  EXPECT_NEAR(covered / kNumRuns, 0.683, 0.03);
  EXPECT_NEAR(covered_twice / kNumRuns, 0.954, 0.015);
}

TEST(GlorotVariance, IsThatOfInitialWeights) {
  const DenseNetwork network({100, 50, 20}, Activation::kTanh);
  NumpyRandom random(1);
  const VectorXd weights =
      network.InitialWeights(Initialization::kGlorotUniform, &random);
  const VectorXd relative =
      weights.cwiseAbs2().cwiseQuotient(GlorotVariance(network));
  // 6,000 of the 6,070 are no biases.
  EXPECT_NEAR(relative.sum() / 6000.0, 1.0, 0.05);
}

TEST(ResidualsOf, HasJAndTheDifferenceForAnyFactorOfTheLoss) {
  const DenseNetwork line({1, 1}, Activation::kTanh);
  const DataSet samples = {Eigen::RowVector3d(-1.0, 0.5, 2.0),
                           MatrixXd(0, 3),
                           Eigen::RowVector3d(1.0, 1.0, 4.0),
                           {}};
  const Eigen::Vector2d weights(3.0, -1.0);
  for (const double factor : {0.5, 2.0}) {
    for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
      const Model model(line,
                        std::make_shared<IdentitySimulator>(1),
                        std::make_shared<SquaredNormLoss>(1, factor),
                        reduction);
      const auto [J, r] = ResidualsOf(model, weights, samples);
      MatrixXd expected(3, 2);
      expected << samples.inputs.transpose(), VectorXd::Ones(3);
      EXPECT_LT((J - expected).norm(), 1e-14);
      EXPECT_LT((r - Eigen::Vector3d(-5.0, -0.5, 1.0)).norm(), 1e-13);
    }
  }
}

}  // namespace error_bars_test
}  // namespace invgrad
