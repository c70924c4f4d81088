// The rule krylov.

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/step_of.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace krylov_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Linearization RandomLinearization(int m, int n) {
  std::mt19937 generator(100 * m + n);
  std::normal_distribution<double> normal;
  const auto next = [&]() { return normal(generator); };
  Linearization at_x;
  const MatrixXd J = MatrixXd::NullaryExpr(m, n, next);
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  at_x.loss_gradient = VectorXd::NullaryExpr(m, next);
  at_x.gradient = J.transpose() * at_x.loss_gradient;
  return at_x;
}

MatrixXd Dense(const Linearization& at_x) {
  MatrixXd J;
  at_x.jacobian->ToDense(&J);
  return J;
}

VectorXd KrylovStep(const std::string& kappa,
                    int iterations,
                    const Linearization& at_x) {
  return StepOf("krylov:step_size=1:kappa=" + kappa +
                    ":iterations=" + std::to_string(iterations),
                at_x);
}

// k = 1: rho = |J v|, v = J^T g / |J^T g|, step = -rho^(-1 - kappa) J^T g.
TEST(KrylovRule, OneIterationIsAScaledGradient) {
  const Linearization at_x = RandomLinearization(9, 6);
  const double rho = (Dense(at_x) * at_x.gradient.normalized()).norm();
  for (const double kappa : {-1.0, 0.5, 1.0}) {
    const VectorXd expected = -std::pow(rho, -1.0 - kappa) * at_x.gradient;
    const VectorXd step = KrylovStep(std::to_string(kappa), 1, at_x);
    EXPECT_LE((step - expected).norm(), 1e-13 * expected.norm());
  }
}

TEST(KrylovRule, AsManyIterationsAsTheRankAreThePowerRule) {
  for (const auto& [m, n] : {std::pair<int, int>{9, 6}, {6, 9}}) {
    const Linearization at_x = RandomLinearization(m, n);
    for (const std::string kappa : {"-1", "-0.5", "0.5", "1"}) {
      const VectorXd expected = StepOf("power:route=svd:kappa=" + kappa, at_x);
      for (const int iterations : {6, 40}) {
        EXPECT_LE((KrylovStep(kappa, iterations, at_x) - expected).norm(),
                  1e-10 * expected.norm());
      }
    }
  }
}

// kappa = 1: -step minimizes |J d - g| over the span of b, A b, A^2 b with
// A = J^T J, b = J^T g.
TEST(KrylovRule, TheFullInverseIsTheIterateOfLsqr) {
  const Linearization at_x = RandomLinearization(12, 8);
  const MatrixXd J = Dense(at_x);
  MatrixXd K(8, 3);
  K.col(0) = at_x.gradient;
  K.col(1) = J.transpose() * (J * K.col(0));
  K.col(2) = J.transpose() * (J * K.col(1));
  const MatrixXd Q = Orthonormalized(K);
  const VectorXd expected = -Q * LeastSquares(J * Q, at_x.loss_gradient);
  EXPECT_LE((KrylovStep("1", 3, at_x) - expected).norm(),
            1e-11 * expected.norm());
}

// (g, J) -> c (g, J) multiplies the step by c^(1 - kappa), at any k.
TEST(KrylovRule, ScalingLaw) {
  const Linearization at_x = RandomLinearization(12, 8);
  Linearization scaled = at_x;
  scaled.jacobian = std::make_shared<DenseJacobian>(7.0 * Dense(at_x));
  scaled.loss_gradient *= 7.0;
  const VectorXd expected = std::sqrt(7.0) * KrylovStep("0.5", 3, at_x);
  EXPECT_LE((KrylovStep("0.5", 3, scaled) - expected).norm(),
            1e-12 * expected.norm());
}

// g . J d = -h . (X S phi X^T) h < 0 at any k, so that there always is an
// automatic step size: rho |J d|^2 = -g . J step for H_L = I.
TEST(KrylovRule, EveryIterateIsADescentDirection) {
  const Linearization at_x = RandomLinearization(30, 20);
  const MatrixXd J = Dense(at_x);
  for (const std::string kappa : {"-0.5", "0.5", "1"}) {
    for (const std::string iterations : {"1", "2", "5", "12", "20"}) {
      const VectorXd step = StepOf(
          "krylov:rho=0.5:kappa=" + kappa + ":iterations=" + iterations, at_x);
      const VectorXd Jd = J * step;
      EXPECT_LT(at_x.loss_gradient.dot(Jd), 0.0);
      EXPECT_NEAR(Jd.squaredNorm(),
                  -0.5 * at_x.loss_gradient.dot(Jd),
                  1e-12 * Jd.squaredNorm());
    }
  }
}

TEST(KrylovRule, ATruncatedStepEndsWhenItIsDone) {
  Linearization at_x;
  const VectorXd s = VectorXd::LinSpaced(40, 0.0, -4.0).unaryExpr([](double x) {
    return std::pow(10.0, x);
  });
  at_x.jacobian = std::make_shared<DenseJacobian>(s.asDiagonal());
  at_x.loss_gradient = VectorXd::Ones(40);
  const std::unique_ptr<UpdateRule> rule =
      MakeRule("krylov:step_size=1:truncation=0.105:tolerance=1e-6");
  const VectorXd step = StepOf(rule.get(), at_x);
  for (int i = 0; i < 40; ++i) {
    EXPECT_NEAR(step[i], s[i] > 0.105 ? -1.0 / std::sqrt(s[i]) : 0.0, 1e-5);
  }
  const std::string report = rule->LastStepReport();
  EXPECT_NE(report.find(" iterations, 10 values down to 0.12 s_max"),
            std::string::npos)
      << report;
  EXPECT_EQ(report.find("40 iterations"), std::string::npos) << report;
}

// Values far below s_max are rounding errors, which kappa = 1/2 would magnify.
TEST(KrylovRule, DoesNotInvertRoundingErrors) {
  const auto orthonormal = [](int rows) {
    return Orthonormalized(Dense(RandomLinearization(rows, 30)));
  };
  const MatrixXd U = orthonormal(60);
  const MatrixXd V = orthonormal(50);
  // 1, 0.2, .., 2.5e-6, 5e-7, .., 5e-21.
  VectorXd s(30);
  VectorXd phi(30);
  for (int i = 0; i < 30; ++i) {
    s[i] = std::pow(10.0, -0.7 * i);
    phi[i] = s[i] > 1e-6 ? 1.0 / std::sqrt(s[i]) : 0.0;
  }
  Linearization at_x = RandomLinearization(60, 50);
  const MatrixXd J = U * s.asDiagonal() * V.transpose();
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  at_x.gradient = J.transpose() * at_x.loss_gradient;
  const VectorXd expected =
      -V * phi.asDiagonal() * U.transpose() * at_x.loss_gradient;
  // The tolerance of the iteration is 0.01.
  EXPECT_LE((StepOf("krylov:step_size=1", at_x) - expected).norm(),
            0.02 * expected.norm());
}

TEST(KrylovRule, AZeroGradientIsAStepOfZero) {
  Linearization at_x = RandomLinearization(5, 3);
  at_x.loss_gradient.setZero();
  EXPECT_TRUE(StepOf("krylov", at_x).isZero(0.0));
}

TEST(KrylovRule, ReportsWhatIsNotFinite) {
  Linearization at_x = RandomLinearization(5, 3);
  at_x.loss_gradient[2] = std::numeric_limits<double>::quiet_NaN();
  VectorXd step;
  std::string error;
  EXPECT_FALSE(MakeRule("krylov")->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error, "g is not finite: entry 2 is nan");
}

}  // namespace krylov_rule_test
}  // namespace invgrad
