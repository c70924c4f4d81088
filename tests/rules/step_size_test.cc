#include "invgrad/rules/step_size.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/chain/loss_on_curve.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/real_infidelity.h"

namespace invgrad {
namespace step_size_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(StepSizeOptions, Schedules) {
  StepSizeOptions options;
  options.step_size = 8.0;
  options.final_fraction = 0.25;
  const auto at = [&options](const char* schedule, double progress) {
    options.schedule = schedule;
    return options.Scheduled(progress);
  };
  EXPECT_EQ(at("constant", 0.0), 8.0);
  EXPECT_EQ(at("constant", 1.0), 8.0);
  for (const char* schedule : {"linear", "cosine", "exponential"}) {
    EXPECT_DOUBLE_EQ(at(schedule, 0.0), 8.0) << schedule;
    EXPECT_DOUBLE_EQ(at(schedule, 1.0), 2.0) << schedule;
    EXPECT_DOUBLE_EQ(at(schedule, 1.5), 2.0) << schedule;
  }
  EXPECT_DOUBLE_EQ(at("linear", 0.5), 5.0);
  EXPECT_DOUBLE_EQ(at("cosine", 0.5), 5.0);
  EXPECT_DOUBLE_EQ(at("cosine", 1.0 / 3.0), 8.0 * (0.25 + 0.75 * 0.75));
  EXPECT_DOUBLE_EQ(at("exponential", 0.5), 4.0);
}

TEST(StepSizeOptions, OnlyWithAJacobianMayItBeAuto) {
  std::string error;
  StepSizeOptions options;
  OptionSet with_auto;
  options.Describe(true, &with_auto);
  EXPECT_EQ(with_auto.rows().size(), 4u);
  EXPECT_TRUE(with_auto.Set("step_size", "auto", &error));
  EXPECT_TRUE(options.is_auto());
  EXPECT_FALSE(with_auto.Set("rho", "2", &error));
  EXPECT_EQ(error, "rho=2 is out of range; allowed: (0, 2)");
  StepSizeOptions fixed;
  OptionSet without_auto;
  fixed.Describe(false, &without_auto);
  EXPECT_EQ(without_auto.rows().size(), 3u);
  EXPECT_FALSE(without_auto.Set("step_size", "auto", &error));
  EXPECT_FALSE(without_auto.Set("final_fraction", "0", &error));
  EXPECT_FALSE(fixed.is_auto());
}

TEST(StepSizeOptions, Defaults) {
  EXPECT_EQ(StepSizeOptions{}.step_size, 1.0);
  EXPECT_EQ(StepSizeOptions{}.schedule, "constant");
  EXPECT_EQ(StepSizeOptions{}.final_fraction, 0.01);
  EXPECT_EQ(StepSizeOptions{}.rho, 0.3);
}

TEST(StepSizeOptionsDeathTest, AutoHasNoFixedValue) {
  StepSizeOptions options;
  options.step_size = std::nullopt;
  EXPECT_DEATH(options.Scheduled(0.0), "depends on the direction");
  OptionSet set;
  EXPECT_DEATH(options.Describe(false, &set), "no automatic step size");
}

// L = 1/2 |y|^2 at y = g, or 1/2 y . H y with H = diag(h).
Linearization AtPoint(const MatrixXd& J, const VectorXd& g) {
  Linearization at_x;
  at_x.loss_gradient = g;
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  return at_x;
}

// The model along d, and its minimizer.
bool AutoStepSize(const Linearization& at_x,
                  const VectorXd& d,
                  double rho,
                  double* eta,
                  std::string* error) {
  AlongDirection model;
  return ModelAlong(at_x, d, &model, error) &&
         AutoStepSize(model, rho, eta, error);
}

TEST(ModelAlong, IsTheQuadraticModelOfTheLoss) {
  MatrixXd J(2, 3);
  J << 1.0, 2.0, 0.5, -1.0, 0.5, 3.0;
  Linearization at_x = AtPoint(J, Vector2d(2.0, -1.0));
  at_x.loss_hessian_times = [](const VectorXd& v) {
    return VectorXd(Vector2d(3.0, -5.0).cwiseProduct(v));
  };
  const Eigen::Vector3d d(0.5, -1.0, 2.0);
  const VectorXd Jd = J * d;
  AlongDirection model;
  std::string error;
  ASSERT_TRUE(ModelAlong(at_x, d, &model, &error)) << error;
  EXPECT_DOUBLE_EQ(model.unit, Jd.lpNorm<Eigen::Infinity>());
  const double unit = model.unit;
  EXPECT_DOUBLE_EQ(unit * model.slope, at_x.loss_gradient.dot(Jd));
  EXPECT_DOUBLE_EQ(unit * unit * model.curvature,
                   Jd.dot(at_x.loss_hessian_times(Jd)));
  EXPECT_EQ(model.curve, nullptr);
  const auto change = [&](double eta) {
    return eta * at_x.loss_gradient.dot(Jd) +
           0.5 * eta * eta * Jd.dot(at_x.loss_hessian_times(Jd));
  };
  EXPECT_NEAR(model.Change(0.3), change(0.3), 1e-14 * std::abs(change(0.3)));
  EXPECT_EQ(model.Change(0.0), 0.0);
  // A rule's damping curves it upwards, too.
  model.damping = 2.0;
  EXPECT_DOUBLE_EQ(model.Change(0.3), change(0.3) + 0.09 * unit * unit);
}

TEST(AutoStepSize, MinimizesTheLinearModelAlongTheDirection) {
  MatrixXd J(2, 3);
  J << 1.0, 2.0, 0.5, -1.0, 0.5, 3.0;
  Linearization at_x = AtPoint(J, Vector2d(2.0, -1.0));
  const VectorXd d = -J.transpose() * at_x.loss_gradient;
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(AutoStepSize(at_x, d, 1.0, &eta, &error)) << error;
  // At the minimum the new gradient is orthogonal to the direction.
  const VectorXd Jd = J * d;
  EXPECT_NEAR((at_x.loss_gradient + eta * Jd).dot(Jd), 0.0, 1e-13);
  double third = 0.0;
  ASSERT_TRUE(AutoStepSize(at_x, d, 1.0 / 3.0, &third, &error));
  EXPECT_DOUBLE_EQ(third, eta / 3.0);
  // With a loss of its own.
  at_x.loss_hessian_times = [](const VectorXd& v) {
    return VectorXd(Vector2d(3.0, 5.0).cwiseProduct(v));
  };
  ASSERT_TRUE(AutoStepSize(at_x, d, 1.0, &eta, &error));
  EXPECT_NEAR((at_x.loss_gradient + eta * at_x.loss_hessian_times(Jd)).dot(Jd),
              0.0,
              1e-13);
  // The formula itself, bit for bit.
  const double unit = Jd.lpNorm<Eigen::Infinity>();
  const VectorXd w = Jd / unit;
  EXPECT_EQ(eta,
            -1.0 * at_x.loss_gradient.dot(w) /
                w.dot(at_x.loss_hessian_times(w)) / unit);
  // The step eta d does not depend on the length of d.
  double scaled = 0.0;
  for (const double scale : {1e-200, 1e200}) {
    ASSERT_TRUE(AutoStepSize(at_x, scale * d, 1.0, &scaled, &error)) << error;
    EXPECT_NEAR(scaled * scale / eta, 1.0, 1e-14);
  }
}

TEST(AutoStepSize, SaysWhyThereIsNone) {
  Linearization at_x = AtPoint(MatrixXd::Identity(2, 2), Vector2d(2.0, 0.0));
  double eta = 0.0;
  std::string error;
  EXPECT_FALSE(AutoStepSize(at_x, Vector2d(0.0, 0.0), 0.3, &eta, &error));
  EXPECT_EQ(error, "J d = 0, so the linear model has no minimizer");
  EXPECT_FALSE(AutoStepSize(at_x, Vector2d(3.0, 0.0), 0.3, &eta, &error));
  EXPECT_EQ(error, "step_size=auto: not a descent direction, slope 6");
  EXPECT_FALSE(AutoStepSize(at_x, Vector2d(kNaN, 0.0), 0.3, &eta, &error));
  EXPECT_EQ(error, "J d is not finite: entry 0 is nan");
  at_x.loss_hessian_times = [](const VectorXd& v) { return VectorXd(-v); };
  EXPECT_FALSE(AutoStepSize(at_x, Vector2d(-3.0, 0.0), 0.3, &eta, &error));
  EXPECT_EQ(error,
            "step_size=auto: the loss does not curve upwards along the "
            "direction, curvature -9");
  at_x.loss_gradient[0] = kNaN;
  EXPECT_FALSE(AutoStepSize(at_x, Vector2d(-3.0, 0.0), 0.3, &eta, &error));
  EXPECT_EQ(eta, 0.0) << "written on failure";
}

// One sample a state (cos x, sin x) with the target (1, 0): L = sin(x)^2, which
// falls towards x = 0. `speeds`: dx/deta along d.
Linearization OnCircles(const VectorXd& x, const VectorXd& speeds) {
  const Eigen::Index num_samples = x.size();
  MatrixXd y(2, num_samples), t(2, num_samples), targets(2, num_samples);
  y << x.array().cos().transpose(), x.array().sin().transpose();
  t << -y.row(1), y.row(0);
  t *= speeds.asDiagonal();
  targets.colwise() = Vector2d(1.0, 0.0);
  Linearization at_x = AtPoint(t.reshaped(), VectorXd::Zero(2 * num_samples));
  at_x.loss_on_curve =
      MakeLossOnCurve(std::make_shared<RealInfidelity<2>>(), y, targets, 1.0);
  return at_x;
}

const VectorXd kAlong = VectorXd::Ones(1);

// sin(x + eta v)^2 has its minimum where x + eta v = 0, near and far.
TEST(AutoStepSizeOnACurve, OfOneSampleIsExact) {
  for (const double x : {-1.5, -0.7, -1e-2, -1e-6, 1.5, 1e-3}) {
    for (const double speed : {1e-200, 0.3, 1e200}) {
      SCOPED_TRACE(testing::Message() << x << " " << speed);
      const double v = x < 0.0 ? speed : -speed;
      const Linearization at_x =
          OnCircles(VectorXd::Constant(1, x), VectorXd::Constant(1, v));
      double eta = 0.0;
      std::string error;
      ASSERT_TRUE(AutoStepSize(at_x, kAlong, 1.0, &eta, &error)) << error;
      // The minimum is flat: the slope is sin(2 x) with a rounding of 1e-16.
      EXPECT_NEAR(x + eta * v, 0.0, 1e-10 * std::abs(x) + 1e-15);
      double third = 0.0;
      ASSERT_TRUE(AutoStepSize(at_x, kAlong, 1.0 / 3.0, &third, &error));
      EXPECT_DOUBLE_EQ(third, eta / 3.0);
    }
  }
}

// sin(a + eta)^2 + sin(b + eta)^2 = 1 - cos(a - b) cos(a + b + 2 eta).
TEST(AutoStepSizeOnACurve, OfTwoSamplesIsBetweenThem) {
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(AutoStepSize(OnCircles(Vector2d(-1.1, -0.2), Vector2d::Ones()),
                           kAlong,
                           1.0,
                           &eta,
                           &error))
      << error;
  EXPECT_NEAR(eta, 0.65, 1e-9);
}

// Samples that turn at different speeds: the loss has many minima, and the one
// that counts is the first, on a grid that sees them all.
TEST(AutoStepSizeOnACurve, IsTheFirstMinimumOfMany) {
  Eigen::Vector3d x(-0.3, -1.4, 0.9);
  Eigen::Vector3d speeds(3.0, 0.25, 1.1);
  const Linearization at_x = OnCircles(x, speeds);
  AlongDirection model;
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(ModelAlong(at_x, kAlong, &model, &error)) << error;
  ASSERT_TRUE(AutoStepSize(model, 1.0, &eta, &error)) << error;
  const auto loss = [&](double along) {
    return (x + along * speeds).array().sin().square().sum();
  };
  EXPECT_NEAR(((2.0 * (x + eta * speeds)).array().sin() * speeds.array()).sum(),
              0.0,
              1e-8);
  constexpr int kNumPoints = 1000;
  for (int k = 0; k < kNumPoints; ++k) {
    EXPECT_GT(loss(eta * k / kNumPoints), loss(eta * (k + 1.0) / kNumPoints));
    const double along = 2.0 * eta * k / kNumPoints;
    EXPECT_NEAR(model.Change(along), loss(along) - loss(0.0), 1e-14);
  }
  EXPECT_GT(loss(1.01 * eta), loss(eta));
  EXPECT_LT(loss(2.188), loss(eta) - 1.0) << "a later minimum is deeper";
}

TEST(AutoStepSizeOnACurve, TakesFewGradients) {
  Linearization at_x = OnCircles(Eigen::Vector3d(-0.3, -1.4, 0.9),
                                 Eigen::Vector3d(3.0, 0.25, 1.1));
  int num_calls = 0;
  at_x.loss_on_curve = [&num_calls, curve = at_x.loss_on_curve](
                           const VectorXd& t, double along) {
    ++num_calls;
    return curve(t, along);
  };
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(AutoStepSize(at_x, kAlong, 1.0, &eta, &error)) << error;
  EXPECT_LE(num_calls, 20);
}

// A fast sample without overlap, whose loss does not change, and a slow one that
// is far from its minimum.
TEST(AutoStepSizeOnACurve, EndsAfterHalfATurnOfTheFastestSample) {
  MatrixXd y(3, 2), t(3, 2), targets(3, 2);
  y.col(0) = Eigen::Vector3d::UnitY();
  t.col(0) = 2.0 * Eigen::Vector3d::UnitZ();
  y.col(1) = Eigen::Vector3d(std::cos(1.2), -std::sin(1.2), 0.0);
  t.col(1) = 0.01 * Eigen::Vector3d(std::sin(1.2), std::cos(1.2), 0.0);
  targets.colwise() = Eigen::Vector3d::UnitX();
  Linearization at_x = AtPoint(t.reshaped(), VectorXd::Zero(6));
  at_x.loss_on_curve =
      MakeLossOnCurve(std::make_shared<RealInfidelity<3>>(), y, targets, 1.0);
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(AutoStepSize(at_x, kAlong, 0.5, &eta, &error)) << error;
  EXPECT_NEAR(eta, 0.25 * M_PI, 1e-12);
}

// With damping c the slope sin(2 (x + eta)) + c eta vanishes earlier.
TEST(AutoStepSizeOnACurve, TakesTheDampingOfARule) {
  const Linearization at_x =
      OnCircles(VectorXd::Constant(1, -0.7), VectorXd::Ones(1));
  AlongDirection model;
  double eta = 0.0;
  std::string error;
  ASSERT_TRUE(ModelAlong(at_x, kAlong, &model, &error)) << error;
  model.damping = 3.0 / model.unit / model.unit;
  ASSERT_TRUE(AutoStepSize(model, 1.0, &eta, &error)) << error;
  EXPECT_NEAR(std::sin(2.0 * (eta - 0.7)) + 3.0 * eta, 0.0, 1e-9);
  EXPECT_NEAR(model.Change(eta),
              std::pow(std::sin(eta - 0.7), 2.0) -
                  std::pow(std::sin(0.7), 2.0) + 1.5 * eta * eta,
              1e-14);
}

TEST(AutoStepSizeOnACurve, SaysWhyThereIsNone) {
  double eta = 0.0;
  std::string error;
  const VectorXd one = VectorXd::Ones(1);
  EXPECT_FALSE(
      AutoStepSize(OnCircles(0.5 * one, one), kAlong, 0.3, &eta, &error));
  EXPECT_EQ(error.rfind("step_size=auto: not a descent direction, slope", 0), 0)
      << error;
  EXPECT_FALSE(
      AutoStepSize(OnCircles(0.5 * one, 0.0 * one), kAlong, 0.3, &eta, &error));
  EXPECT_EQ(error, "J d = 0, so the linear model has no minimizer");
  // Along y itself nothing moves.
  Linearization radial = OnCircles(0.0 * one, one);
  radial.jacobian = std::make_shared<DenseJacobian>(Vector2d(1.0, 0.0));
  EXPECT_FALSE(AutoStepSize(radial, kAlong, 0.3, &eta, &error));
  EXPECT_EQ(error.rfind("step_size=auto: not a descent direction, slope", 0), 0)
      << error;
  // Not finite from the start, and from somewhere on the way.
  for (const double end : {0.0, 0.2, 0.5}) {
    Linearization broken = OnCircles(-0.5 * one, one);
    broken.loss_on_curve = [end, curve = broken.loss_on_curve](
                               const VectorXd& t, double along) {
      return along < end ? curve(t, along) : LossOnCurve{kNaN, kNaN, kNaN};
    };
    EXPECT_FALSE(AutoStepSize(broken, kAlong, 0.3, &eta, &error)) << end;
    EXPECT_EQ(error.rfind("step_size=auto: ", 0), 0) << error;
  }
  EXPECT_EQ(eta, 0.0) << "written on failure";
}

}  // namespace step_size_test
}  // namespace invgrad
