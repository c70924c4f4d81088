#include "invgrad/inverse/loss_pull_back.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/loss.h"

namespace invgrad {
namespace loss_pull_back_test {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr LossWay kAllWays[] = {LossWay::kGradient,
                                LossWay::kNewton,
                                LossWay::kSaddleFreeNewton,
                                LossWay::kTarget};

// L = sum |d_i|^3 / 3, d = y - y*, without a matrix H_L.
class CubicWithoutMatrix final : public Loss {
 public:
  int size() const override { return 2; }
  bool forms_hessian() const override { return false; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override {
    EXPECT_EQ(hessian, nullptr);
    *loss = 0.0;
    for (int i = 0; i < 2; ++i) {
      const double d = y[i] - target[i];
      *loss += std::abs(d * d * d) / 3.0;
      if (gradient != nullptr) gradient[i] = d * std::abs(d);
    }
    return true;
  }
  VectorXd HessianTimes(const double* y,
                        const double* target,
                        const VectorXd& v) const override {
    return Vector2d(2.0 * std::abs(y[0] - target[0]) * v[0],
                    2.0 * std::abs(y[1] - target[1]) * v[1]);
  }
};

// L = scale (d0^4 / 4 + d1^4 / 2 + d0^2 + d1^2 + d0 d1 / 2), d = y - y*, with y
// = A z + b the quartic's own coordinates: convex.
struct Quartic {
  template <typename T>
  bool operator()(const T* z, const double* target, T* loss) const {
    const T d0 = A(0, 0) * z[0] + A(0, 1) * z[1] + (b[0] - target[0]);
    const T d1 = A(1, 0) * z[0] + A(1, 1) * z[1] + (b[1] - target[1]);
    *loss = scale * (0.25 * d0 * d0 * d0 * d0 + 0.5 * d1 * d1 * d1 * d1 +
                     d0 * d0 + d1 * d1 + 0.5 * d0 * d1);
    return true;
  }
  double scale = 1.0;
  Matrix2d A = Matrix2d::Identity();
  Vector2d b = Vector2d::Zero();
};

// L = sum_i log cosh(y_i - y*_i).
struct LogCosh {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    using std::exp;
    using std::log;
    *loss = T(0.0);
    for (int i = 0; i < 2; ++i) {
      const T d = y[i] - target[i];
      *loss += log(0.5 * (exp(d) + exp(-d)));
    }
    return true;
  }
};

// L = 1/2 d . M d + d0^3 / 6 with an indefinite M.
struct Indefinite {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T d0 = y[0] - target[0];
    const T d1 = y[1] - target[1];
    const T d2 = y[2] - target[2];
    *loss = 0.5 * (2.0 * d0 * d0 - 3.0 * d1 * d1 + 0.5 * d2 * d2) + d0 * d1 -
            0.7 * d1 * d2 + d0 * d0 * d0 / 6.0;
    return true;
  }
};

// L = (d0 + d1)^2: flat along (1, -1).
struct Valley {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T sum = y[0] - target[0] + (y[1] - target[1]);
    *loss = sum * sum;
    return true;
  }
};

template <int kSize, typename Functor>
std::shared_ptr<const Loss> MakeLoss(Functor functor = Functor()) {
  return std::make_shared<AutoDiffLoss<Functor, kSize>>(functor);
}

// d_y; fails the test if there is none.
VectorXd Change(const std::shared_ptr<const Loss>& loss,
                LossWay way,
                double step_size,
                const VectorXd& y,
                const VectorXd& target) {
  double value = 0.0;
  double expected_value = 0.0;
  VectorXd change(y.size());
  std::string why = "untouched";
  EXPECT_TRUE(LossPullBack(loss, way, step_size)
                  .Step(y.data(), target.data(), &value, change.data(), &why))
      << why;
  EXPECT_EQ(why, "untouched");
  EXPECT_TRUE(loss->Evaluate(
      y.data(), target.data(), &expected_value, nullptr, nullptr));
  // With and without Jets, the sums may be rounded differently.
  EXPECT_NEAR(value, expected_value, 1e-14 * (1.0 + std::abs(expected_value)));
  return change;
}

// g and H_L.
void Derivatives(const Loss& loss,
                 const VectorXd& y,
                 const VectorXd& target,
                 VectorXd* g,
                 MatrixXd* H) {
  double value = 0.0;
  g->resize(y.size());
  H->resize(y.size(), y.size());
  ASSERT_TRUE(
      loss.Evaluate(y.data(), target.data(), &value, g->data(), H->data()));
}

TEST(LossPullBackTest, OfASquaredNormIsTheWayToTheTarget) {
  const Vector3d y(3.0, -1.0, 0.25);
  const Vector3d target(1.0, 0.5, 0.25);
  for (const double factor : {1e-9, 0.5, 1.0, 3.0, 1e12}) {
    const auto loss = std::make_shared<SquaredNormLoss>(3, factor);
    for (const double eta : {1.0, 0.5, 2.0}) {
      const Vector3d way = eta * (target - y);  // exact in binary
      EXPECT_EQ(Change(loss, LossWay::kNewton, eta, y, target), way);
      EXPECT_EQ(Change(loss, LossWay::kSaddleFreeNewton, eta, y, target), way);
      const Vector3d descent = Change(loss, LossWay::kGradient, eta, y, target);
      // Two products more than `way` has.
      EXPECT_LE((descent - 2.0 * factor * way).norm(), 4e-16 * descent.norm());
    }
  }
}

// For log cosh: g = tanh d, H = 1 / cosh^2 d, so H^-1 g = sinh d cosh d.
TEST(LossPullBackTest, OfLogCoshIsTheClosedForm) {
  const auto loss = MakeLoss<2>(LogCosh());
  const Vector2d target(0.3, -0.2);
  const Vector2d d(1.1, -0.6);
  for (const double eta : {1.0, 0.3}) {
    for (const LossWay way : kAllWays) {
      const Vector2d change = Change(loss, way, eta, target + d, target);
      for (int i = 0; i < 2; ++i) {
        const double expected = way == LossWay::kGradient ? std::tanh(d[i])
                                : way == LossWay::kTarget
                                    ? d[i]
                                    : std::sinh(d[i]) * std::cosh(d[i]);
        // A dozen roundings, magnified by cosh^2 d < 3.
        EXPECT_NEAR(change[i], -eta * expected, 1e-14);
      }
    }
  }
}

TEST(LossPullBackTest, NewtonSolvesWithTheHessian) {
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  const auto loss = MakeLoss<2>(Quartic());
  VectorXd g;
  MatrixXd H;
  Derivatives(*loss, y, target, &g, &H);
  ASSERT_GT(g.norm(), 1.0);
  for (const double eta : {1.0, 0.3}) {
    const VectorXd expected = -eta * H.inverse() * g;
    // The condition number of H is below 10.
    EXPECT_LT(
        (Change(loss, LossWay::kNewton, eta, y, target) - expected).norm(),
        1e-14);
    // Where H is positive definite, |H| = H.
    EXPECT_LT(
        (Change(loss, LossWay::kSaddleFreeNewton, eta, y, target) - expected)
            .norm(),
        1e-14);
    EXPECT_LT(
        (Change(loss, LossWay::kGradient, eta, y, target) + eta * g).norm(),
        1e-14);
  }
}

// |H| is the root of H^2, taken here by Eigen's solver for operatorSqrt.
TEST(LossPullBackTest, SaddleFreeNewtonSolvesWithTheAbsoluteHessian) {
  const Vector3d target(0.3, -0.2, 0.1);
  const Vector3d y(1.5, 0.7, -0.8);
  const auto loss = MakeLoss<3>(Indefinite());
  VectorXd g;
  MatrixXd H;
  Derivatives(*loss, y, target, &g, &H);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> of_h(H);
  ASSERT_LT(of_h.eigenvalues()[0], -0.1);
  ASSERT_GT(of_h.eigenvalues()[2], 0.1);
  const MatrixXd absolute =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(MatrixXd(H * H)).operatorSqrt();
  const double eta = 0.7;
  const VectorXd saddle_free =
      Change(loss, LossWay::kSaddleFreeNewton, eta, y, target);
  const VectorXd newton = Change(loss, LossWay::kNewton, eta, y, target);
  // The condition number of H^2 is below 1e3.
  EXPECT_LT((saddle_free + eta * absolute.inverse() * g).norm(), 1e-12);
  EXPECT_LT((newton + eta * H.inverse() * g).norm(), 1e-13);
  EXPECT_LT(saddle_free.dot(g), 0.0);  // descends
  EXPECT_GT((saddle_free - newton).norm(), 0.1);
}

TEST(LossPullBackTest, NewtonRefusesASingularHessian) {
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  const auto valley = MakeLoss<2>(Valley());
  const auto linear = std::make_shared<DotProductLoss>(2);
  for (const std::shared_ptr<const Loss>& loss :
       {valley, std::shared_ptr<const Loss>(linear)}) {
    double value = 0.0;
    Vector2d change;
    std::string why;
    EXPECT_FALSE(
        LossPullBack(loss, LossWay::kNewton, 1.0)
            .Step(y.data(), target.data(), &value, change.data(), &why));
    EXPECT_NE(why.find("Hessian of the loss is singular"), std::string::npos)
        << why;
    EXPECT_NE(why.find("saddle_free_newton"), std::string::npos) << why;
  }
}

TEST(LossPullBackTest, SaddleFreeNewtonDoesNotMoveAlongAFlatDirection) {
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  // The nearest point of the valley's floor.
  const double sum = (y - target).sum();
  EXPECT_LT(
      (Change(
           MakeLoss<2>(Valley()), LossWay::kSaddleFreeNewton, 0.5, y, target) +
       0.25 * sum * Vector2d::Ones())
          .norm(),
      1e-15);
  // No direction of a linear loss is curved.
  EXPECT_EQ(Change(std::make_shared<DotProductLoss>(2),
                   LossWay::kSaddleFreeNewton,
                   0.5,
                   y,
                   target),
            Vector2d::Zero());
}

TEST(LossPullBackTest, NewtonDoesNotSeeAFactorOfTheLoss) {
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  for (const LossWay way : kAllWays) {
    const VectorXd change = Change(MakeLoss<2>(Quartic()), way, 0.8, y, target);
    for (const double factor : {1e-7, 0.25, 1024.0, 3e9}) {
      Quartic scaled;
      scaled.scale = factor;
      const VectorXd of_scaled =
          Change(MakeLoss<2>(scaled), way, 0.8, y, target);
      const double expected = way == LossWay::kGradient ? factor : 1.0;
      EXPECT_LE((of_scaled - expected * change).norm(),
                1e-14 * of_scaled.norm());
    }
  }
}

// With y = A z + b, a step d_z that is covariant has A d_z = d_y.
TEST(LossPullBackTest, NewtonIsCovariantUnderAnAffineChangeOfCoordinates) {
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  Quartic transformed;
  transformed.b = Vector2d(0.4, -2.0);
  const Matrix2d rotated = (Matrix2d() << 2.0, -1.0, 0.5, 3.0).finished();
  // Units a million apart; the rounding grows with the square of their ratio.
  const Matrix2d units = Vector2d(1.0, 1e-6).asDiagonal();
  for (const Matrix2d& A : {rotated, units}) {
    transformed.A = A;
    const Vector2d z = A.inverse() * (y - transformed.b);
    const auto error = [&](LossWay way) {
      const Vector2d d_y = Change(MakeLoss<2>(Quartic()), way, 0.8, y, target);
      const Vector2d d_z =
          Change(MakeLoss<2>(transformed), way, 0.8, z, target);
      return (A * d_z - d_y).norm() / d_y.norm();
    };
    EXPECT_LT(error(LossWay::kNewton), 1e-9);
    EXPECT_GT(error(LossWay::kGradient), 0.1);  // contravariant by A A^T
  }
}

// L = (d_0 / unit)^2 / 2 + d_1^2 / 2, so that H^-1 g = d for any unit.
struct InSigmas {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T d0 = (y[0] - target[0]) / unit;
    const T d1 = y[1] - target[1];
    *loss = 0.5 * (d0 * d0 + d1 * d1);
    return true;
  }
  double unit = 1.0;
};

TEST(LossPullBackTest, NewtonHoldsForOutputsInAnyUnits) {
  for (const double unit : {1e-12, 1e-9, 1e-7, 1.0, 1e7, 1e9, 1e12}) {
    const Vector2d d(1.2 * unit, 0.9);
    const Vector2d target(0.0, -0.2);
    for (const LossWay way : {LossWay::kNewton, LossWay::kSaddleFreeNewton}) {
      const Vector2d change =
          Change(MakeLoss<2>(InSigmas{unit}), way, 1.0, target + d, target);
      for (int i = 0; i < 2; ++i) {
        EXPECT_NEAR(change[i], -d[i], 1e-14 * d[i]) << unit;
      }
    }
  }
}

TEST(LossPullBackTest, RefusesALossWithoutAFiniteValue) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector2d target(0.3, -0.2);
  const std::shared_ptr<const Loss> losses[] = {
      std::make_shared<SquaredNormLoss>(2, 1.0),
      MakeLoss<2>(Quartic()),
      MakeLoss<2>(LogCosh())};
  for (const auto& loss : losses) {
    // The powers of the last overflow, and so do exponentials.
    for (const Vector2d& y : {Vector2d(nan, 0.0), Vector2d(0.0, 1e200)}) {
      for (const LossWay way : kAllWays) {
        double value = 0.0;
        Vector2d change;
        std::string why;
        EXPECT_FALSE(
            LossPullBack(loss, way, 1.0)
                .Step(y.data(), target.data(), &value, change.data(), &why));
        EXPECT_EQ(why, "the loss has no finite value");
      }
    }
  }
}

TEST(LossPullBackTest, RefusesAStepThatOverflows) {
  const auto loss = std::make_shared<SquaredNormLoss>(1, 1e-300);
  const double y = 1e150;
  const double target = 0.0;
  double value = 0.0;
  double change = 0.0;
  std::string why;
  EXPECT_FALSE(LossPullBack(loss, LossWay::kNewton, 1e200)
                   .Step(&y, &target, &value, &change, &why));
  EXPECT_EQ(why, "the step in y is not finite");
}

// Where H_L has no matrix, the target and the gradient are the ways, and both
// have products.
TEST(LossPullBackTest, OfALossWithoutAMatrixForItsHessian) {
  const auto loss = std::make_shared<CubicWithoutMatrix>();
  const Vector2d y(2.0, -1.0), target(0.5, 1.0), v(1.0, 10.0);
  double value = 0.0;
  Vector2d change;
  std::string why;
  for (const LossWay way : {LossWay::kNewton, LossWay::kSaddleFreeNewton}) {
    EXPECT_FALSE(
        LossPullBack(loss, way, 1.0)
            .Step(y.data(), target.data(), &value, change.data(), &why));
    EXPECT_EQ(why,
              "the Hessian of the loss is too large to form; use target or "
              "gradient for the loss");
  }
  const LossPullBack to_target(loss, LossWay::kTarget, 0.5);
  ASSERT_TRUE(
      to_target.Step(y.data(), target.data(), &value, change.data(), &why));
  EXPECT_EQ(change, Vector2d(-0.75, 1.0));
  EXPECT_NEAR(value, (1.5 * 1.5 * 1.5 + 8.0) / 3.0, 1e-14);
  EXPECT_FALSE(to_target.forms_hessian());
  EXPECT_EQ(to_target.HessianTimes(y.data(), target.data(), v), VectorXd(v));
  const LossPullBack by_gradient(loss, LossWay::kGradient, 0.5);
  EXPECT_EQ(by_gradient.HessianTimes(y.data(), target.data(), v),
            VectorXd(Vector2d(1.5, 20.0)));
}

TEST(LossPullBackDeathTest, RefusesWhatMakesNoSense) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto loss = std::make_shared<SquaredNormLoss>(1, 1.0);
  EXPECT_DEATH(LossPullBack(nullptr, LossWay::kNewton, 1.0), "loss");
  EXPECT_DEATH(LossPullBack(loss, LossWay::kNewton, 0.0), "step_size");
}

class PulledBackLossTest : public testing::TestWithParam<LossWay> {};

TEST_P(PulledBackLossTest, HasTheStatedDerivatives) {
  const LossWay way = GetParam();
  const double eta = 0.7;
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1.5, 0.7);
  const std::shared_ptr<const Loss> losses[] = {
      std::make_shared<SquaredNormLoss>(2, 1.5), MakeLoss<2>(Quartic())};
  for (const auto& loss : losses) {
    const LossPullBack pulled_back(loss, way, eta);
    EXPECT_EQ(pulled_back.size(), 2);
    // No factor: Ceres' trust regions must not take it for |y - y*|^2.
    EXPECT_FALSE(pulled_back.SquaredNormFactor().has_value());
    VectorXd g;
    MatrixXd H;
    Derivatives(*loss, y, target, &g, &H);
    const VectorXd change = Change(loss, way, eta, y, target);
    double expected = 0.0;
    ASSERT_TRUE(
        loss->Evaluate(y.data(), target.data(), &expected, nullptr, nullptr));
    for (const bool want_gradient : {false, true}) {
      for (const bool want_hessian : {false, true}) {
        double value = 0.0;
        Vector2d gradient;
        Matrix2d hessian;
        ASSERT_TRUE(
            pulled_back.Evaluate(y.data(),
                                 target.data(),
                                 &value,
                                 want_gradient ? gradient.data() : nullptr,
                                 want_hessian ? hessian.data() : nullptr));
        EXPECT_NEAR(value, expected, 1e-14);
        if (want_gradient) {
          EXPECT_EQ(gradient, -change);
        }
        if (want_hessian && way == LossWay::kGradient) {
          EXPECT_LT((hessian - eta * H).norm(), 1e-14);
        } else if (want_hessian) {
          EXPECT_EQ(hessian, Matrix2d::Identity());
        }
      }
    }
  }
}

TEST_P(PulledBackLossTest, FailsWhereThePullBackDoes) {
  const LossPullBack pulled_back(MakeLoss<2>(Quartic()), GetParam(), 1.0);
  const Vector2d target(0.3, -0.2);
  const Vector2d y(1e200, 0.0);
  double value = 0.0;
  Vector2d gradient;
  Matrix2d hessian;
  EXPECT_FALSE(
      pulled_back.Evaluate(y.data(), target.data(), &value, nullptr, nullptr));
  EXPECT_FALSE(pulled_back.Evaluate(
      y.data(), target.data(), &value, gradient.data(), nullptr));
  EXPECT_FALSE(pulled_back.Evaluate(
      y.data(), target.data(), &value, nullptr, hessian.data()));
}

INSTANTIATE_TEST_SUITE_P(Ways, PulledBackLossTest, testing::ValuesIn(kAllWays));

}  // namespace loss_pull_back_test
}  // namespace invgrad
