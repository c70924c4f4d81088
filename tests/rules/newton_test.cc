// The rules newton and saddle_free_newton.

#include <cmath>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "tests/rules/step_of.h"

namespace invgrad {
namespace newton_test {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

VectorXd StepFor(UpdateRule* rule,
                 const MatrixXd& H,
                 const VectorXd& gradient) {
  Linearization at_x;
  at_x.gradient = gradient;
  at_x.hessian = H;
  return StepOf(rule, at_x);
}

TEST(Newton, Defaults) {
  for (const char* name : {"newton", "saddle_free_newton"}) {
    const auto options = FindRule(name)->options();
    ASSERT_EQ(options.size(), 4u);
    EXPECT_EQ(options[0].default_value, "1");
    EXPECT_EQ(options[3].name, "fallback_step_size");
    EXPECT_EQ(options[3].default_value, "0.01");
  }
}

TEST(Newton, OneStepSolvesAQuadratic) {
  Matrix2d H;
  H << 4.0, 1.0, 1.0, 3.0;
  const Vector2d solution(2.0, -5.0);
  for (const char* name : {"newton", "saddle_free_newton"}) {
    const auto rule = MakeRule(name);
    const VectorXd step = StepFor(rule.get(), H, H * -solution);
    EXPECT_LE((step - solution).norm(), 1e-14 * solution.norm());
  }
}

// The book "Physics-based Deep Learning" (arXiv 2109.05237), L = x1^2 + x2^4
// from (3, 3) with eta = 1/3: printed iterates in single precision, and their
// closed form.
TEST(Newton, PublishedIterates) {
  const Vector2d printed[] = {{2.0, 2.6666667},
                              {1.3333333, 2.3703704},
                              {0.88888884, 2.1069958},
                              {0.59259254, 1.8728852},
                              {0.39506167, 1.6647868},
                              {0.26337445, 1.4798105},
                              {0.17558296, 1.315387},
                              {0.1170553, 1.1692328},
                              {0.07803687, 1.0393181},
                              {0.05202458, 0.92383826}};
  const auto rule = MakeRule("newton:step_size=0.33333333333333333");
  Vector2d x(3.0, 3.0);
  for (const Vector2d& expected : printed) {
    const Vector2d gradient(2.0 * x[0], 4.0 * std::pow(x[1], 3));
    const Matrix2d H = Vector2d(2.0, 12.0 * x[1] * x[1]).asDiagonal();
    x += StepFor(rule.get(), H, gradient);
    EXPECT_LE((x - expected).norm(), 1e-6);
  }
  EXPECT_NEAR(x[0], 3.0 * std::pow(2.0 / 3.0, 10), 1e-14);
  EXPECT_NEAR(x[1], 3.0 * std::pow(8.0 / 9.0, 10), 1e-14);
}

TEST(Newton, UnitsDoNotMatter) {
  MatrixXd H(3, 3);
  H << 2.0, 1.0, 0.0, 1.0, -1.0, 0.5, 0.0, 0.5, 3.0;
  const Vector3d gradient(1.0, 2.0, -1.0);
  const auto rule = MakeRule("newton");
  const VectorXd step = StepFor(rule.get(), H, gradient);
  // x = units .* x', so H' = units H units, and the step's entries shrink.
  const Vector3d units(1e-20, 1.0, 1e15);
  const VectorXd scaled = StepFor(rule.get(),
                                  units.asDiagonal() * H * units.asDiagonal(),
                                  units.cwiseProduct(gradient));
  EXPECT_LE((units.cwiseProduct(scaled) - step).norm(), 1e-13 * step.norm());
  EXPECT_EQ(rule->LastStepReport().rfind("Newton step", 0), 0u);
}

TEST(Newton, ASingularHessianGivesAGradientDescentStep) {
  const Vector2d gradient(3.0, -2.0);
  Matrix2d rank_one;
  rank_one << 1.0, 2.0, 2.0, 4.0;
  Matrix2d nearly = rank_one;
  nearly(1, 1) = std::nextafter(4.0, 5.0);
  const Matrix2d flat = Vector2d(1.0, 0.0).asDiagonal();
  const auto rule = MakeRule("newton");
  for (const Matrix2d& H :
       {Matrix2d(Matrix2d::Zero()), rank_one, nearly, flat}) {
    EXPECT_LE((StepFor(rule.get(), H, gradient) + 0.01 * gradient).norm(),
              1e-16)
        << H;
    EXPECT_EQ(rule->LastStepReport(),
              "Hessian singular: gradient-descent step");
  }
  StepFor(rule.get(), Matrix2d::Identity(), gradient);
  EXPECT_EQ(rule->LastStepReport(), "Newton step, reciprocal condition 1");
}

// A saddle: Newton goes to it, the saddle-free form away from it.
TEST(Newton, AtASaddle) {
  const Matrix2d H = Vector2d(2.0, -4.0).asDiagonal();
  const Vector2d gradient(2.0, -4.0);
  const auto newton = MakeRule("newton");
  EXPECT_LE((StepFor(newton.get(), H, gradient) - Vector2d(-1.0, -1.0)).norm(),
            1e-15);
  const auto saddle_free = MakeRule("saddle_free_newton");
  EXPECT_LE(
      (StepFor(saddle_free.get(), H, gradient) - Vector2d(-1.0, 1.0)).norm(),
      1e-15);
  EXPECT_EQ(saddle_free->LastStepReport(),
            "1 negative and 0 flat of 2 curvatures");
}

TEST(Newton, SaddleFreeDescendsAlongFlatDirections) {
  const auto rule = MakeRule("saddle_free_newton");
  const Matrix2d H = Vector2d(2.0, 1e-17).asDiagonal();
  EXPECT_LE((StepFor(rule.get(), H, Vector2d(2.0, 5.0)) - Vector2d(-1.0, -0.05))
                .norm(),
            1e-15);
  EXPECT_EQ(rule->LastStepReport(), "0 negative and 1 flat of 2 curvatures");
  EXPECT_LE((StepFor(rule.get(), Matrix2d::Zero(), Vector2d(2.0, 5.0)) +
             0.01 * Vector2d(2.0, 5.0))
                .norm(),
            1e-15);
}

TEST(Newton, RefusesAHessianThatIsNotFinite) {
  for (const char* name : {"newton", "saddle_free_newton"}) {
    const auto rule = MakeRule(name);
    Linearization at_x;
    at_x.gradient = Vector2d(1.0, 1.0);
    at_x.hessian = Matrix2d::Identity();
    at_x.hessian(0, 1) = NAN;
    VectorXd step;
    std::string error;
    EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
    EXPECT_EQ(error, "the Hessian is not finite: entry (0, 1) is nan");
  }
}

}  // namespace newton_test
}  // namespace invgrad
