#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/determined_step.h"
#include "invgrad/internal/qr.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace determined_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Linearization At(const MatrixXd& J,
                 const VectorXd& g,
                 const std::vector<int>& block_sizes = {}) {
  Linearization at_x;
  at_x.loss_gradient = g;
  at_x.jacobian = std::make_shared<DenseJacobian>(J, block_sizes);
  return at_x;
}

// Columns of very different lengths, of which two are nearly the same.
MatrixXd NearlySingular(int m, int n) {
  MatrixXd J = RandomMatrix(m, n, 3);
  J.col(2) = J.col(0) + 1e-6 * J.col(2);
  for (int i = 0; i < n; ++i) J.col(i) *= std::pow(10.0, i - 3);
  return J;
}

TEST(DeterminedRule, IsTheStepOfTheFunction) {
  for (const auto& [m, n] : {std::pair(40, 8), std::pair(5, 8)}) {
    const MatrixXd J = NearlySingular(m, n);
    const VectorXd g = RandomMatrix(m, 1, 4);
    DeterminedStepOptions options;
    options.tau = 1e-3;
    DeterminedStepOfAnySize function(options);
    VectorXd expected;
    std::string error;
    ASSERT_TRUE(function.Compute(
        J.transpose() * J, J.transpose() * g, &expected, &error));
    EXPECT_GE(function.num_left_alone(), 1);
    const auto rule = MakeRule("determined:truncation=1e-3");
    const VectorXd step = StepOf(rule.get(), At(J, g));
    // Of two Gram matrices that differ by rounding.
    for (int i = 0; i < n; ++i) {
      EXPECT_NEAR(step[i], expected[i], 1e-7 * std::pow(10.0, 3 - i));
    }
    EXPECT_EQ(rule->LastStepReport().substr(0, 4),
              std::to_string(function.num_left_alone()) + " of");
  }
}

// Another problem of the same size has other blocks.
TEST(DeterminedRule, TakesTheBlocksOfTheProblem) {
  const MatrixXd J = NearlySingular(40, 6);
  const VectorXd g = RandomMatrix(40, 1, 4);
  const auto rule = MakeRule("determined:groups=blocks");
  StepOf(rule.get(), At(J, g, {3, 3}));
  const VectorXd step = StepOf(rule.get(), At(J, g, {2, 4}));
  EXPECT_EQ(step, StepOf("determined:groups=blocks", At(J, g, {2, 4})));
}

TEST(DeterminedRule, AutomaticStepSizeUndoesTheScaleOfTheLoss) {
  const MatrixXd J = NearlySingular(40, 8);
  const VectorXd g = RandomMatrix(40, 1, 4);
  const VectorXd expected = StepOf("determined", At(J, g));
  Linearization scaled = At(J, 0.02 * g);
  scaled.loss_hessian_times = [](const VectorXd& v) -> VectorXd {
    return 0.02 * v;
  };
  const VectorXd step = StepOf("determined:step_size=auto:rho=1", scaled);
  EXPECT_LT((step - expected).norm(), 1e-8 * expected.norm());
}

TEST(DeterminedRule, BlocksShareAScale) {
  const double a = 0.2;
  const Eigen::Vector2d along(std::cos(a), std::sin(a));
  MatrixXd J = MatrixXd::Zero(3, 3);
  J.topLeftCorner(2, 2) << -along[1], along[0], along[1], -along[0];
  J(2, 2) = 1e-5;
  const Linearization at_x = At(J, Eigen::Vector3d(0.1, -0.1, 1e-5), {2, 1});
  const VectorXd blocks = StepOf("determined:groups=blocks", at_x);
  EXPECT_NEAR(blocks.head(2).dot(along), 0.0, 1e-12);
  EXPECT_NEAR(blocks[2], -1.0, 1e-12);
  const VectorXd columns = StepOf("determined", at_x);
  EXPECT_NEAR(
      std::abs(columns.head(2).dot(along)), 0.1 / std::tan(2.0 * a), 1e-10);
}

TEST(DeterminedRule, RemembersWhatItLeftAlone) {
  const VectorXd g = VectorXd::Ones(3);
  const auto J = [](double s) -> MatrixXd {
    const MatrixXd V = Orthonormalized(RandomMatrix(3, 3, 2));
    return Eigen::Vector3d(1.0, 0.5, s).asDiagonal() * V.transpose();
  };
  const std::string text = "determined:truncation=0.1:release=1.5";
  const auto rule = MakeRule(text);
  const auto report = [&](UpdateRule* of, double s) {
    StepOf(of, At(J(s), g, {3}));
    return of->LastStepReport().substr(0, 6);
  };
  const std::string grouped = text + ":groups=blocks";
  const auto remembering = MakeRule(grouped);
  EXPECT_EQ(report(remembering.get(), 0.12), "all 3 ");
  EXPECT_EQ(report(remembering.get(), 0.08), "1 of 3");
  EXPECT_EQ(report(remembering.get(), 0.12), "1 of 3");
  const auto resumed = MakeRule(grouped);
  *resumed->MutableState()[0] = *remembering->MutableState()[0];
  EXPECT_EQ(report(resumed.get(), 0.12), "1 of 3");
  EXPECT_EQ(report(remembering.get(), 0.16), "all 3 ");
}

}  // namespace determined_rule_test
}  // namespace invgrad
