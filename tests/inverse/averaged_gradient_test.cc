// The physical gradient is a gradient averaged over the way from x to x~, and a
// descent in place of the inverse is a gradient method in x.

#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "problems/problems.h"
#include "tests/inverse/pull_one_back.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace averaged_gradient_test {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

const Vector2d kX(0.4, -1.0);
const Vector2d kChange(1.3, 2.0);

// J = [exp x0, 0; 2 x0, 1]
Matrix2d BendJacobian(const Vector2d& x) {
  Matrix2d J;
  J << std::exp(x[0]), 0.0, 2.0 * x[0], 1.0;
  return J;
}

// The mean over t in [0, 1], by Simpson's rule; 400 intervals leave 1e-12.
Matrix2d Mean(const std::function<Matrix2d(double)>& function) {
  constexpr int kNumIntervals = 400;
  Matrix2d sum = function(0.0) + function(1.0);
  for (int i = 1; i < kNumIntervals; ++i) {
    const double t = static_cast<double>(i) / kNumIntervals;
    sum += (i % 2 == 0 ? 2.0 : 4.0) * function(t);
  }
  return sum / (3.0 * kNumIntervals);
}

VectorXd PhysicalGradient() {
  return Pull(SimulatorPullBack(MakeSimulator<2, 2>(Bend()),
                                ExactBendInverse(),
                                Way(SimulatorWay::kInverse)),
              kX,
              kChange)
      .d_x;
}

// PBDL, chapter physgrad: d_x / d_y = 1 / d_y int dx/dy dy.
TEST(PhysicalGradient, IsTheInverseGradientAveragedOverTheWayInY) {
  Vector2d y;
  ASSERT_TRUE(Bend()(kX.data(), y.data()));
  const Matrix2d mean = Mean([&](double t) -> Matrix2d {
    return BendJacobian(BendInverse(y + t * kChange)).inverse();
  });
  EXPECT_LT((PhysicalGradient() - mean * kChange).norm(), 1e-11);
  // The local one is another.
  const Vector2d local = BendJacobian(kX).inverse() * kChange;
  EXPECT_GT((PhysicalGradient() - local).norm(), 0.1);
}

// "A path integral along any differentiable path": along a way in y with a
// bulge to the side the integral of dx/dy dy stays, but the mean of dx/dy does
// not turn the change of y into that of x any more.
TEST(PhysicalGradient, IsTheIntegralOfTheInverseGradientAlongAnyWay) {
  const Vector2d side(-kChange[1], kChange[0]);
  Vector2d y;
  ASSERT_TRUE(Bend()(kX.data(), y.data()));
  for (const double bulge : {0.1, 0.2, 0.4}) {
    const auto dx_dy = [&](double t) -> Matrix2d {
      const Vector2d at = y + t * kChange + bulge * std::sin(M_PI * t) * side;
      return BendJacobian(BendInverse(at)).inverse();
    };
    const Matrix2d integrals = Mean([&](double t) {
      const Vector2d velocity =
          kChange + bulge * M_PI * std::cos(M_PI * t) * side;
      Matrix2d columns;
      columns << dx_dy(t) * velocity, dx_dy(t) * kChange;
      return columns;
    });
    EXPECT_LT((integrals.col(0) - PhysicalGradient()).norm(), 1e-9) << bulge;
    EXPECT_GT((integrals.col(1) - PhysicalGradient()).norm(), 0.3 * bulge);
  }
}

TEST(PhysicalGradient, InvertsTheJacobianAveragedOverTheWayInX) {
  const VectorXd d_x = PhysicalGradient();
  const Matrix2d mean =
      Mean([&](double t) { return BendJacobian(kX + t * d_x); });
  EXPECT_LT((mean * d_x - kChange).norm(), 1e-11);
}

// At the crest of the sine, h_0 = 10 x_0 = pi / 2, the gradient is zero, the
// inverse gradient is unbounded, and the physical gradient jumps between the
// ways to the two nearest pre-images.
TEST(PhysicalGradient, IsBoundedAtACrestAndJumpsThere) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(CreateProblem("sine_point:phi=0", nullptr, &problem, &error));
  const PointProblem& sine = *problem.point;
  const double kFromCrest = 1e-4;
  const double at_target = std::asin(sine.target[0]);
  for (const double side : {-1.0, 1.0}) {
    const Vector2d x((M_PI / 2.0 + side * kFromCrest) / 10.0,
                     sine.target[1] / 10.0);
    const Vector2d d_y(sine.target[0] - std::sin(10.0 * x[0]), 0.0);
    const auto pull = [&](SimulatorWay way) {
      return Pull(
                 SimulatorPullBack(sine.simulator, sine.inverse, Way(way, 0.0)),
                 x,
                 d_y)
          .d_x[0];
    };
    EXPECT_LT(std::abs(pull(SimulatorWay::kAdjoint)), 1e-3);
    EXPECT_GT(std::abs(pull(SimulatorWay::kInverseGradient)), 100.0);
    EXPECT_NEAR(pull(SimulatorWay::kInverse),
                side * (M_PI / 2.0 - at_target - kFromCrest) / 10.0,
                1e-12);
  }
}

SimulatorPullBack::Options Descent(int num_steps, double step_size) {
  SimulatorPullBack::Options options = Way(SimulatorWay::kGradientDescent);
  options.gradient_descent = {num_steps, step_size, false};
  return options;
}

// x after every step to x~, N times, with k steps of gradient descent as the
// inverse.
VectorXd Iterate(const std::shared_ptr<const Simulator>& simulator,
                 const VectorXd& start,
                 const VectorXd& target,
                 const SimulatorPullBack::Options& way,
                 int num_iterations) {
  const SimulatorPullBack pull_back(simulator, nullptr, way);
  VectorXd x = start;
  for (int i = 0; i < num_iterations; ++i) {
    VectorXd y(target.size());
    EXPECT_TRUE(simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
    x += Pull(pull_back, x, target - y).d_x;
  }
  return x;
}

TEST(DescentAsInverse, IsGradientDescentForAnyNumberOfInnerSteps) {
  constexpr double kStepSize = 0.04;
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d target(2.8, 1.0);
  Vector2d expected = kX;
  for (int i = 0; i < 48; ++i) {
    Vector2d y;
    ASSERT_TRUE(Bend()(expected.data(), y.data()));
    expected += kStepSize * BendJacobian(expected).transpose() * (target - y);
  }
  for (const int k : {1, 3, 8, 48}) {
    const VectorXd x =
        Iterate(simulator, kX, target, Descent(k, kStepSize), 48 / k);
    EXPECT_LT((x - expected).norm(), 1e-13) << k;
  }
}

// The error along a singular vector falls by (1 - eta s^2)^k in an iteration:
// first order for every k, and only for k to infinity the step of an inverse.
TEST(DescentAsInverse, ConvergesLinearlyAtARateThatFallsWithTheInnerSteps) {
  const Vector2d s(2.0, 0.5);
  const auto simulator = MakeLinear(s.asDiagonal().toDenseMatrix());
  const double eta = 0.25 / 2.0;
  for (const int k : {1, 4, 16, 64}) {
    const VectorXd error = Iterate(
        simulator, Vector2d(1.0, 1.0), Vector2d::Zero(), Descent(k, eta), 3);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(error[i], std::pow(1.0 - eta * s[i] * s[i], 3 * k), 1e-14)
          << k;
    }
  }
}

}  // namespace averaged_gradient_test
}  // namespace invgrad
