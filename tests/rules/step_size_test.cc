#include "invgrad/rules/step_size.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "gtest/gtest.h"

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
  EXPECT_DOUBLE_EQ(unit * unit * model.squared_length, Jd.squaredNorm());
  EXPECT_DOUBLE_EQ(unit * unit * model.squared_hessian_length,
                   at_x.loss_hessian_times(Jd).squaredNorm());
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

}  // namespace step_size_test
}  // namespace invgrad
