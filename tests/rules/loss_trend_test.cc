#include "invgrad/rules/loss_trend.h"

#include <cmath>
#include <random>
#include <vector>

#include "Eigen/Dense"
#include "gtest/gtest.h"

namespace invgrad {
namespace loss_trend_test {

TEST(LossTrend, OfAnExponentialDecayIsExact) {
  LossTrend trend;
  for (int k = 0; k < 200; ++k) {
    EXPECT_EQ(trend.known(), k >= 10);
    trend.Add(5.0 * std::exp(-0.03 * k));
  }
  EXPECT_NEAR(trend.slope(), -0.03, 1e-12);
  EXPECT_NEAR(trend.slope_error(), 0.0, 1e-7);
}

TEST(LossTrend, IsAWeightedLeastSquaresFit) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const int size = 120;
  LossTrend trend;
  Eigen::MatrixXd A(size, 2);
  Eigen::VectorXd l(size), w(size);
  for (int k = 0; k < size; ++k) {
    l[k] = 2.0 - 0.01 * k + 0.3 * normal(generator);
    trend.Add(std::exp(l[k]));
    w[k] = std::pow(0.98, size - 1 - k);
    A.row(k) << 1.0, k;
  }
  const Eigen::MatrixXd normal_matrix = A.transpose() * w.asDiagonal() * A;
  const Eigen::VectorXd fit =
      normal_matrix.ldlt().solve(A.transpose() * w.cwiseProduct(l));
  EXPECT_NEAR(trend.slope(), fit[1], 1e-11);
  const double variance = w.dot((l - A * fit).cwiseAbs2()) / w.sum();
  EXPECT_NEAR(trend.slope_error(),
              std::sqrt(variance * normal_matrix.inverse()(1, 1)),
              1e-11);
}

TEST(LossTrend, DoesNotDependOnTheUnitsOfTheLoss) {
  LossTrend one, other;
  for (int k = 0; k < 30; ++k) {
    const double loss = 1.0 + 0.5 * std::sin(k);
    one.Add(loss);
    other.Add(1e12 * loss);
  }
  EXPECT_NEAR(one.slope(), other.slope(), 1e-10);
  EXPECT_EQ(one.IsOutlier(3.0), other.IsOutlier(3e12));
}

TEST(LossTrend, AnOutlierIsFarAboveTheLine) {
  LossTrend trend;
  // Residuals of +-0.1: standard deviation 0.1, so that log 2 decides.
  for (int k = 0; k < 100; ++k) trend.Add(std::exp(k % 2 == 0 ? 0.1 : -0.1));
  EXPECT_FALSE(trend.IsOutlier(1.9));
  EXPECT_TRUE(trend.IsOutlier(2.1));
  EXPECT_FALSE(trend.IsOutlier(1e-9));  // below
  LossTrend wide;
  // Standard deviation 1: an outlier is above e^2.5 = 12.2.
  for (int k = 0; k < 400; ++k) wide.Add(std::exp(k % 2 == 0 ? 1.0 : -1.0));
  EXPECT_FALSE(wide.IsOutlier(10.0));
  EXPECT_TRUE(wide.IsOutlier(15.0));
}

TEST(LossTrend, RestartForgetsEverything) {
  LossTrend trend, fresh;
  for (int k = 0; k < 50; ++k) trend.Add(std::exp(0.2 * k));
  trend.Restart();
  EXPECT_FALSE(trend.known());
  for (int k = 0; k < 12; ++k) {
    trend.Add(1.0 + k);
    fresh.Add(1.0 + k);
  }
  EXPECT_EQ(trend.slope(), fresh.slope());
}

TEST(LossTrend, ZeroLossesAreSmallOnes) {
  LossTrend trend;
  for (int k = 0; k < 20; ++k) trend.Add(0.0);
  EXPECT_NEAR(trend.slope(), 0.0, 1e-9);
  EXPECT_TRUE(std::isfinite(trend.slope_error()));
  EXPECT_DEATH(trend.Add(std::nan("")), "nan");
}

TEST(LossTrend, IsUnknownAtFirst) {
  EXPECT_DEATH(LossTrend().slope(), "known");
}

}  // namespace loss_trend_test
}  // namespace invgrad
