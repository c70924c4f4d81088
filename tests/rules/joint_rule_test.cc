#include "invgrad/rules/joint_rule.h"

#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Geometry"
#include "gtest/gtest.h"
#include "invgrad/chain/loss_on_curve.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/internal/qr.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "invgrad/update_rule.h"
#include "tests/support/least_squares.h"
#include "tests/support/random_matrix.h"
#include "tests/support/real_infidelity.h"

namespace invgrad {
namespace joint_rule_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// An infidelity: y = (cos x, sin x), L = 1 - (e_1 . y)^2 = sin(x)^2, whose H_L
// is negative. Along the circle it curves like 2 cos(2 x).
Linearization Infidelity(double x) {
  Linearization at_x;
  const Vector2d y(std::cos(x), std::sin(x));
  at_x.cost = y[1] * y[1];
  at_x.loss_gradient = Vector2d(-2.0 * y[0], 0.0);
  at_x.jacobian = std::make_shared<DenseJacobian>(Vector2d(-y[1], y[0]));
  at_x.loss_hessian_times = [](const VectorXd& v) -> VectorXd {
    return Vector2d(-2.0 * v[0], 0.0);
  };
  at_x.loss_on_curve = MakeLossOnCurve(
      std::make_shared<RealInfidelity<2>>(), y, Vector2d(1.0, 0.0), 1.0);
  return at_x;
}

// Those that need no layers.
const char* const kRules[] = {
    "half_inverse", "gauss_newton", "levenberg_marquardt", "krylov"};

// The simulator turns the state by the step, so the curve is exact: every step
// goes rho of the way, even where H_L and the circle curve downwards (x = 1.2).
TEST(JointRule, AutomaticStepsOnALossWithAnInvariant) {
  for (const std::string name : kRules) {
    for (const std::string control : {"none", "gain"}) {
      SCOPED_TRACE(name + " " + control);
      const auto rule = MakeRule(name + ":step_size=auto:control=" + control);
      double x = 1.2;
      VectorXd step;
      std::string error;
      for (int k = 0; k < 10; ++k) {
        const Linearization at_x = Infidelity(x);
        ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
        EXPECT_NEAR(step[0], -0.3 * x, 1e-9);
        const double cost = Infidelity(x + step[0]).cost;
        EXPECT_TRUE(rule->judge() == nullptr ||
                    rule->judge()->KeepsStep(cost, 1.0));
        x += step[0];
      }
      EXPECT_NEAR(x, 1.2 * std::pow(0.7, 10.0), 1e-8);
    }
  }
}

TEST(JointRule, ALossThatCurvesDownwardsHasNoAutomaticStep) {
  for (const std::string name : kRules) {
    for (const std::string control : {"none", "gain"}) {
      SCOPED_TRACE(name + " " + control);
      const auto rule = MakeRule(name + ":step_size=auto:control=" + control);
      Linearization at_x = Infidelity(1.2);
      at_x.loss_on_curve = nullptr;
      VectorXd step;
      std::string error;
      EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
      EXPECT_EQ(error.rfind("step_size=auto: the loss does not curve upwards "
                            "along the direction, curvature -",
                            0),
                0)
          << error;
    }
  }
}

// J^T g = 0 with g != 0: exactly, and up to roundings of either sign.
TEST(JointRule, AtAMinimumTheStepIsZero) {
  MatrixXd rotated(3, 2);
  rotated << 2.0, -1.0, 0.5, 3.0, -1.5, 0.7;
  const Eigen::Vector3d a = rotated.col(0);
  const Eigen::Vector3d b = rotated.col(1);
  for (const std::string name : kRules) {
    for (const char* step_size : {"auto", "1"}) {
      SCOPED_TRACE(name + " " + step_size);
      const std::string text = name + ":control=gain:step_size=" + step_size;
      Linearization at_x;
      at_x.cost = 0.5;
      at_x.jacobian = std::make_shared<DenseJacobian>(MatrixXd::Identity(3, 2));
      at_x.loss_gradient = Eigen::Vector3d(0.0, 0.0, 1.0);
      const auto rule = MakeRule(text);
      VectorXd step;
      std::string error;
      ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
      EXPECT_TRUE(step.isZero(0.0));
      EXPECT_TRUE(rule->judge()->KeepsStep(at_x.cost, 1.0));
      at_x.jacobian = std::make_shared<DenseJacobian>(rotated);
      for (const double sign : {-1.0, 1.0}) {
        at_x.loss_gradient = sign * a.cross(b).normalized();
        ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
        EXPECT_LT(step.norm(), 1e-14);
        EXPECT_TRUE(rule->judge()->KeepsStep(at_x.cost, 1.0));
      }
    }
  }
}

// Without control, too; about half of the slopes are roundings upwards.
TEST(JointRule, AtAMinimumTheAutomaticStepIsZero) {
  for (const std::string name :
       {"half_inverse", "gauss_newton", "krylov", "determined"}) {
    for (int seed = 0; seed < 20; ++seed) {
      SCOPED_TRACE(name + " " + std::to_string(seed));
      const MatrixXd random = RandomMatrix(7, 7, seed);
      const MatrixXd J = random.leftCols(3);
      const MatrixXd Q = Orthonormalized(random);
      Linearization at_x;
      at_x.jacobian = std::make_shared<DenseJacobian>(J);
      at_x.loss_gradient = 1e3 * Q.rightCols(4) * VectorXd::Ones(4);
      at_x.cost = 0.5 * at_x.loss_gradient.squaredNorm();
      VectorXd step;
      std::string error;
      ASSERT_TRUE(
          MakeRule(name + ":step_size=auto")->ComputeStep(at_x, &step, &error))
          << error;
      EXPECT_LT(step.norm(), 1e-10);
    }
  }
}

// A direction that leads upwards is no rounding.
class Uphill final : public JointRule {
 public:
  Uphill() : JointRule(AutomaticStep()) {}

 private:
  static Options AutomaticStep() {
    Options options;
    options.step_size.step_size = std::nullopt;
    return options;
  }
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& /*filter*/,
                        VectorXd* direction,
                        std::string* /*report*/,
                        std::string* /*error*/) override {
    at_x.jacobian->TransposeTimes(-at_x.loss_gradient, direction);
    return true;
  }
};

TEST(JointRule, NoAutomaticStepLeadsUphill) {
  Linearization at_x;
  at_x.jacobian = std::make_shared<DenseJacobian>(MatrixXd::Identity(3, 2));
  at_x.loss_gradient = Eigen::Vector3d(1e-6, 0.0, 1.0);
  VectorXd step;
  std::string error;
  EXPECT_FALSE(Uphill().ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error.find("step_size=auto: not a descent direction"), 0u) << error;
}

// Full Gauss-Newton steps, 2.5 times too long, make a linear problem worse;
// with control they do not.
TEST(JointRule, StepsThatAreTooLongAreShortened) {
  MatrixXd A(3, 2);
  A << 2.0, -1.0, 0.5, 3.0, -1.5, 0.7;
  const Eigen::Vector3d b(1.0, -2.0, 0.5);
  const auto rule =
      MakeRule("gauss_newton:step_size=2.5:control=gain:adapts=nothing");
  const VectorXd best = LeastSquares(A, b);
  VectorXd x = VectorXd::Zero(2);
  int num_undone = 0;
  for (int k = 0; k < 60; ++k) {
    Linearization at_x;
    at_x.loss_gradient = A * x - b;
    at_x.cost = 0.5 * at_x.loss_gradient.squaredNorm();
    at_x.jacobian = std::make_shared<DenseJacobian>(A);
    VectorXd step;
    std::string error;
    ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
    const double cost = 0.5 * (A * (x + step) - b).squaredNorm();
    if (rule->judge()->KeepsStep(cost, 1.0)) {
      EXPECT_LE(cost, at_x.cost * (1.0 + 1e-13));
      x += step;
    } else {
      ++num_undone;
    }
  }
  EXPECT_GT(num_undone, 0);
  EXPECT_LT((x - best).norm(), 1e-6);
}

// What is adapted is used, by every rule: with the control's state at kappa =
// -1 and no damping the direction is the gradient's.
TEST(JointRule, TheFilterIsTheControls) {
  const DenseNetwork network({2, 1}, Activation::kTanh);
  const VectorXd weights = VectorXd::Zero(3);
  DenseNetwork::Activations activations;
  MatrixXd inputs(2, 4);
  inputs << 1.0, -0.5, 2.0, 0.3, 0.7, 1.5, -1.0, 0.2;
  network.Forward(weights, inputs, false, &activations);
  Linearization at_x;
  at_x.jacobian = std::make_shared<NetworkJacobian>(
      network, weights, activations, MatrixXd::Ones(1, 4));
  at_x.loss_gradient = Eigen::Vector4d(1.0, -2.0, 0.5, 3.0);
  at_x.cost = 1.0;
  VectorXd gradient;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
  for (const std::string name :
       {"power", "layer_half_inverse", "kfac_half_inverse", "krylov"}) {
    SCOPED_TRACE(name);
    const auto rule = MakeRule(name + ":step_size=1:control=gain");
    VectorXd& state = *rule->MutableState()[0];
    state[0] = -1.0;
    state[1] = 0.0;
    VectorXd step;
    std::string error;
    ASSERT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
    const double cosine = -step.dot(gradient) / step.norm() / gradient.norm();
    EXPECT_NEAR(cosine, 1.0, 1e-12);
    // And the factor of the step size.
    state[2] = 0.25;
    VectorXd shorter;
    ASSERT_TRUE(rule->ComputeStep(at_x, &shorter, &error)) << error;
    EXPECT_LT((shorter - 0.25 * step).norm(), 1e-15 * step.norm());
    EXPECT_NE(rule->LastStepReport().find("kappa -1, damping 0 s_max^2"),
              std::string::npos)
        << rule->LastStepReport();
  }
}

}  // namespace joint_rule_test
}  // namespace invgrad
