#include "invgrad/loss.h"

#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace loss_test {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

TEST(SquaredNormLossTest, HasTheStatedFactor) {
  const Vector2d y(3.0, -1.0);
  const Vector2d target(1.0, 0.5);
  for (const double factor : {0.5, 1.0, 3.0}) {
    const SquaredNormLoss loss(2, factor);
    ASSERT_TRUE(loss.SquaredNormFactor().has_value());
    EXPECT_EQ(*loss.SquaredNormFactor(), factor);
    EXPECT_FALSE(loss.has_invariant());
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

// R(eta) from y along t, and its derivative.
struct Moved {
  VectorXd point;
  VectorXd velocity;
};

Moved Retracted(const VectorXd& y, const VectorXd& t, double eta) {
  const SquaredNormLoss loss(static_cast<int>(y.size()), 1.0);
  Moved moved = {VectorXd(y.size()), VectorXd(y.size())};
  loss.Retract(
      y.data(), t.data(), eta, moved.point.data(), moved.velocity.data());
  return moved;
}

TEST(Retract, MovesOnAGreatCircle) {
  for (const double radius : {1.0, 1e-100, 1e100}) {
    SCOPED_TRACE(radius);
    const VectorXd y = radius * RandomMatrix(5, 1, 1);
    const VectorXd t = radius * RandomMatrix(5, 1, 2);
    const double norm = y.norm();
    const VectorXd unit_y = y / norm;
    const VectorXd p = t - unit_y.dot(t) * unit_y;
    const Moved start = Retracted(y, t, 0.0);
    EXPECT_EQ(start.point, y);
    EXPECT_LT((start.velocity - p).norm(), 1e-14 * p.norm());
    const double half_turn = M_PI / (p.norm() / norm);
    EXPECT_LT((Retracted(y, t, half_turn).point + y).norm(), 1e-14 * norm);
    for (const double eta : {-0.7, 1e-9, 0.3, 2.0, 40.0}) {
      SCOPED_TRACE(eta);
      const Moved moved = Retracted(y, t, eta);
      // An angle of 40 has a rounding error of 1e-14.
      EXPECT_NEAR(moved.point.norm() / norm, 1.0, 1e-14);
      EXPECT_NEAR(moved.velocity.norm() / p.norm(), 1.0, 1e-14);
      const double cosine = (moved.point / norm).dot(moved.velocity / norm);
      EXPECT_NEAR(cosine, 0.0, 1e-14);
      constexpr double kStep = 1e-5;
      const VectorXd difference = (Retracted(y, t, eta + kStep).point -
                                   Retracted(y, t, eta - kStep).point) /
                                  (2.0 * kStep);
      EXPECT_LT((moved.velocity - difference).norm(), 1e-8 * norm);
    }
  }
}

// t^T H_L t - (y . g) |t|^2 for |y| = 1 and t that keeps |y|: the second term is
// what the straight line misses.
TEST(Retract, CurvesTheLossAsTheSphereDoes) {
  const AutoDiffLoss<SmoothLoss, 2> loss;
  const Vector2d target(0.1, 0.9);
  const Vector2d y(0.6, 0.8);
  const Vector2d t = 1.7 * Vector2d(-0.8, 0.6);
  double value;
  Vector2d g;
  Matrix2d H;
  ASSERT_TRUE(
      loss.Evaluate(y.data(), target.data(), &value, g.data(), H.data()));
  const auto at = [&](double eta) {
    const Moved moved = Retracted(y, t, eta);
    double moved_loss = 0.0;
    EXPECT_TRUE(loss.Evaluate(
        moved.point.data(), target.data(), &moved_loss, nullptr, nullptr));
    return moved_loss;
  };
  constexpr double kStep = 1e-3;
  const double curvature =
      (at(kStep) - 2.0 * at(0.0) + at(-kStep)) / (kStep * kStep);
  const double expected = t.dot(H * t) - y.dot(g) * t.squaredNorm();
  EXPECT_GT(std::abs(y.dot(g)), 1.0);
  EXPECT_NEAR(curvature, expected, 1e-4 * std::abs(expected));
}

TEST(Retract, DoesNotMoveAlongNothing) {
  const Vector2d y(3.0, -4.0);
  const Vector2d zero(0.0, 0.0);
  for (const Vector2d& t : {zero, Vector2d(2.0 * y)}) {
    const Moved moved = Retracted(y, t, 0.7);
    EXPECT_LT((moved.point - y).norm(), 1e-14);
    EXPECT_LT(moved.velocity.norm(), 1e-14);
  }
  const Moved from_zero = Retracted(zero, y, 0.7);
  EXPECT_EQ(from_zero.point, zero);
  EXPECT_EQ(from_zero.velocity, zero);
}

TEST(Retract, ShowsWhatIsNotANumber) {
  const Vector2d y(3.0, -4.0);
  const Vector2d broken(1.0, std::numeric_limits<double>::quiet_NaN());
  for (const Moved& moved : {Retracted(y, broken, 0.7),
                             Retracted(broken, y, 0.7),
                             Retracted(y, Vector2d(1.0, 0.0), broken[1])}) {
    EXPECT_TRUE(moved.point.hasNaN());
    EXPECT_TRUE(moved.velocity.hasNaN());
  }
}

}  // namespace loss_test
}  // namespace invgrad
