#include "invgrad/chain/loss.h"

#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/autodiff_loss.h"

namespace invgrad {
namespace loss_test {

using Eigen::Matrix2d;
using Eigen::Vector2d;

TEST(SquaredNormLossTest, HasTheStatedFactor) {
  const Vector2d y(3.0, -1.0);
  const Vector2d target(1.0, 0.5);
  for (const double factor : {0.5, 1.0, 3.0}) {
    const SquaredNormLoss loss(2, factor);
    ASSERT_TRUE(loss.SquaredNormFactor().has_value());
    EXPECT_EQ(*loss.SquaredNormFactor(), factor);
    double value;
    Vector2d gradient;
    Matrix2d hessian;
    ASSERT_TRUE(loss.Evaluate(
        y.data(), target.data(), &value, gradient.data(), hessian.data()));
    EXPECT_EQ(value, factor * 6.25);  // 4 + 2.25
    EXPECT_EQ(gradient, 2.0 * factor * Vector2d(2.0, -1.5));
    EXPECT_EQ(hessian, 2.0 * factor * Matrix2d::Identity());
  }
}

TEST(SquaredNormLossTest, FailsWhenTheSquareOverflows) {
  const SquaredNormLoss loss(2, 1.0);
  const Vector2d y(1e200, 0.0);
  const Vector2d target(0.0, 0.0);
  double value;
  EXPECT_FALSE(
      loss.Evaluate(y.data(), target.data(), &value, nullptr, nullptr));
}

// L = exp(y0 - t0) y1^2 + log(y1 / t1).
struct SmoothLoss {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    using std::exp;
    using std::log;
    *loss = exp(y[0] - target[0]) * y[1] * y[1] + log(y[1] / target[1]);
    return true;
  }
};

TEST(AutoDiffLossTest, IsTheClosedForm) {
  const AutoDiffLoss<SmoothLoss, 2> loss;
  EXPECT_FALSE(loss.SquaredNormFactor().has_value());
  const Vector2d y(0.3, 1.7);
  const Vector2d target(0.1, 0.9);
  const double e = std::exp(0.2);
  const double expected = e * 1.7 * 1.7 + std::log(1.7 / 0.9);
  const Vector2d expected_gradient(e * 1.7 * 1.7, 2.0 * e * 1.7 + 1.0 / 1.7);
  Matrix2d expected_hessian;
  expected_hessian << e * 1.7 * 1.7, 2.0 * e * 1.7, 2.0 * e * 1.7,
      2.0 * e - 1.0 / (1.7 * 1.7);

  // The values are below 10: a few roundings stay under 1e-14.
  for (const bool want_gradient : {false, true}) {
    for (const bool want_hessian : {false, true}) {
      double value = 0.0;
      Vector2d gradient = Vector2d::Zero();
      Matrix2d hessian = Matrix2d::Zero();
      ASSERT_TRUE(loss.Evaluate(y.data(),
                                target.data(),
                                &value,
                                want_gradient ? gradient.data() : nullptr,
                                want_hessian ? hessian.data() : nullptr));
      EXPECT_NEAR(value, expected, 1e-14);
      if (want_gradient) {
        EXPECT_LT((gradient - expected_gradient).norm(), 1e-14);
      }
      if (want_hessian) {
        EXPECT_LT((hessian - expected_hessian).norm(), 1e-14);
      }
    }
  }
}

TEST(AutoDiffLossTest, FailsWithoutAFiniteValue) {
  const AutoDiffLoss<SmoothLoss, 2> loss;
  const Vector2d y(0.3, 0.0);  // log 0
  const Vector2d target(0.1, 0.9);
  double value;
  Vector2d gradient;
  Matrix2d hessian;
  EXPECT_FALSE(
      loss.Evaluate(y.data(), target.data(), &value, nullptr, nullptr));
  EXPECT_FALSE(
      loss.Evaluate(y.data(), target.data(), &value, gradient.data(), nullptr));
  EXPECT_FALSE(loss.Evaluate(
      y.data(), target.data(), &value, gradient.data(), hessian.data()));
}

}  // namespace loss_test
}  // namespace invgrad
