#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace geodesic_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// L = c / 2 |y|^2 of y = b + A x + (q . x)^2 e: a parabola.
struct Parabola {
  MatrixXd A;
  VectorXd b;
  VectorXd q;
  VectorXd e;
  double c = 1.0;

  VectorXd Outputs(const VectorXd& x) const {
    return b + A * x + q.dot(x) * q.dot(x) * e;
  }
  double Cost(const VectorXd& x) const {
    return 0.5 * c * Outputs(x).squaredNorm();
  }
  MatrixXd J(const VectorXd& x) const {
    return A + 2.0 * q.dot(x) * e * q.transpose();
  }
  Linearization At(const VectorXd& x) const {
    Linearization at_x;
    at_x.cost = Cost(x);
    at_x.loss_gradient = c * Outputs(x);
    at_x.jacobian = std::make_shared<DenseJacobian>(J(x));
    at_x.loss_hessian_times = [c = c](const VectorXd& v) -> VectorXd {
      return c * v;
    };
    at_x.norm_of_x = x.norm();
    at_x.after = [this, x](const VectorXd& step,
                           const LinearizationParts& parts,
                           Linearization* after,
                           std::string*) {
      after->cost = Cost(x + step);
      if (parts.loss_gradient) after->loss_gradient = c * Outputs(x + step);
      return std::isfinite(after->cost);
    };
    return at_x;
  }
};

Parabola MakeParabola(int m, int n, double curvature) {
  return {RandomMatrix(m, n, 1),
          RandomMatrix(m, 1, 2),
          RandomMatrix(n, 1, 3),
          curvature * RandomMatrix(m, 1, 4)};
}

// Of a linear problem the first damping, 1/2 of the setting, is taken.
TEST(GeodesicRule, OfALinearProblemIsTheDampedStep) {
  for (const auto& [m, n] : {std::pair(7, 4), std::pair(4, 7)}) {
    for (const double c : {1.0, 0.02}) {
      Parabola problem = MakeParabola(m, n, 0.0);
      problem.c = c;
      const VectorXd x = RandomMatrix(n, 1, 5);
      const auto rule = MakeRule("geodesic:damping=1e-2");
      const VectorXd step = StepOf(rule.get(), problem.At(x));
      const MatrixXd& A = problem.A;
      MatrixXd H = c * A.transpose() * A;
      H.diagonal().array() += 0.5e-2 * c * A.squaredNorm();
      const VectorXd expected =
          -H.llt().solve(c * A.transpose() * problem.Outputs(x));
      EXPECT_LT((step - expected).norm(), 1e-11 * expected.norm());
      EXPECT_EQ((*rule->MutableState()[0])[0], 0.5e-2);
    }
  }
}

// The unit of the loss changes no step; a power of two, not a bit.
TEST(GeodesicRule, TheUnitOfTheLossDoesNotMatter) {
  for (const auto& [m, n] : {std::pair(7, 4), std::pair(4, 7)}) {
    std::vector<VectorXd> ends;
    for (const int exponent : {0, -60, 60}) {
      Parabola problem = MakeParabola(m, n, 0.2);
      problem.c = std::ldexp(1.0, exponent);
      const auto rule = MakeRule("adaptive");
      VectorXd x = RandomMatrix(n, 1, 5);
      for (int k = 0; k < 20; ++k) x += StepOf(rule.get(), problem.At(x));
      ends.push_back(x);
    }
    EXPECT_EQ(ends[1], ends[0]);
    EXPECT_EQ(ends[2], ends[0]);
  }
}

// The bend is exact for outputs of degree two, whose difference quotient is.
TEST(GeodesicRule, AccelerationIsTheClosedForm) {
  const Parabola problem = MakeParabola(6, 3, 0.02);
  const VectorXd x = RandomMatrix(3, 1, 5);
  const MatrixXd J = problem.J(x);
  MatrixXd H = J.transpose() * J;
  H.diagonal().array() += 0.5e-2 * J.squaredNorm();
  const VectorXd v = -H.llt().solve(J.transpose() * problem.Outputs(x));
  const VectorXd y_vv = 2.0 * problem.q.dot(v) * problem.q.dot(v) * problem.e;
  const VectorXd a = -0.5 * H.llt().solve(J.transpose() * y_vv);
  ASSERT_LT(problem.Cost(x + v + a), problem.Cost(x + v));
  const auto bent = MakeRule("geodesic:damping=1e-2");
  const auto straight = MakeRule("geodesic:damping=1e-2:acceleration=off");
  EXPECT_LT((StepOf(bent.get(), problem.At(x)) - v - a).norm(), 1e-11);
  EXPECT_LT((StepOf(straight.get(), problem.At(x)) - v).norm(), 1e-11);
  EXPECT_NE(bent->LastStepReport().find("accelerated"), std::string::npos);
}

// Of a sparse problem, (1 + lambda) on the diagonal; the gain of a linear one is
// above 3/4, so that the next lambda is a hundredth.
TEST(GeodesicRule, OfASparseLinearProblemTheDampingHasTheUnitsOfJ) {
  MatrixXd A = MatrixXd::Zero(9, 6);
  for (int block = 0; block < 3; ++block) {
    A.block(3 * block, 2 * block, 3, 2) = RandomMatrix(3, 2, block + 1);
  }
  A.block(0, 4, 3, 2) = RandomMatrix(3, 2, 7);
  A.col(3) *= 1e5;
  Parabola problem = {
      A, RandomMatrix(9, 1, 4), VectorXd::Zero(6), VectorXd::Zero(9)};
  const auto rule = MakeRule("geodesic:damping=1e-2");
  VectorXd x = RandomMatrix(6, 1, 5);
  for (const double lambda : {1e-3, 1e-5}) {
    Linearization at_x = problem.At(x);
    at_x.jacobian = std::make_shared<SparseJacobian>(
        SparseJacobian::Matrix(A.sparseView()), std::vector<int>{2, 2, 2});
    const VectorXd step = StepOf(rule.get(), at_x);
    MatrixXd H = A.transpose() * A;
    H.diagonal() *= 1.0 + lambda;
    const VectorXd expected =
        -H.llt().solve(A.transpose() * problem.Outputs(x));
    EXPECT_LT((step - expected).cwiseQuotient(expected).norm(), 1e-8);
    EXPECT_NEAR((*rule->MutableState()[0])[0], lambda, 1e-12 * lambda);
    x += step;
    if (lambda > 1e-4) x += RandomMatrix(6, 1, 6);
  }
}

TEST(GeodesicRule, TheLossFallsByTheGainInEveryStep) {
  const Parabola problem = MakeParabola(8, 5, 3.0);
  for (const double gain : {0.1, 0.9}) {
    const auto rule = MakeRule("geodesic:gain=" + std::to_string(gain));
    VectorXd x = 3.0 * RandomMatrix(5, 1, 5);
    for (int k = 0; k < 300; ++k) {
      const Linearization at_x = problem.At(x);
      const VectorXd step = StepOf(rule.get(), at_x);
      if (step.norm() == 0.0) break;
      EXPECT_LT(problem.Cost(x + step), at_x.cost);
      x += step;
    }
    const VectorXd gradient = problem.J(x).transpose() * problem.Outputs(x);
    EXPECT_LT(gradient.norm(), 1e-6);
  }
}

TEST(GeodesicRule, AStepIsNoLongerThanItsLimit) {
  const Parabola problem = MakeParabola(6, 4, 0.3);
  const VectorXd x = 0.1 * RandomMatrix(4, 1, 7);
  const Linearization at_x = problem.At(x);
  EXPECT_GT(StepOf("geodesic", at_x).norm(), 0.1 * x.norm());
  for (const double limit : {0.1, 1e-3}) {
    const VectorXd step =
        StepOf("geodesic:max_relative_step=" + std::to_string(limit), at_x);
    EXPECT_LE(step.norm(), limit * x.norm());
    // The next damping is four times the last one.
    EXPECT_GE(step.norm(), 0.2 * limit * x.norm());
    EXPECT_LT(problem.Cost(x + step), at_x.cost);
  }
  EXPECT_EQ(StepOf("adaptive", at_x),
            StepOf("geodesic:max_relative_step=0.1", at_x));
  // At x = 0 there is no limit.
  const Linearization at_zero = problem.At(VectorXd::Zero(4));
  EXPECT_EQ(StepOf("adaptive", at_zero), StepOf("geodesic", at_zero));
}

TEST(GeodesicRule, AStepThatItsRowsDetermineHasNoLimit) {
  const VectorXd x = 0.1 * RandomMatrix(4, 1, 7);
  for (const int rows : {7, 8}) {
    const Parabola problem = MakeParabola(rows, 4, 0.3);
    const Linearization at_x = problem.At(x);
    const VectorXd step = StepOf("geodesic", at_x);
    ASSERT_GT(step.norm(), 0.1 * x.norm());
    EXPECT_EQ(StepOf("adaptive", at_x) == step, rows == 8) << rows;
  }
}

TEST(GeodesicRule, AMinimumAndAZeroJacobianHaveNoStep) {
  const auto rule = MakeRule("geodesic");
  Parabola problem = MakeParabola(3, 3, 0.0);
  const VectorXd minimizer = problem.A.lu().solve(-problem.b);
  problem.b = -problem.A * minimizer;
  EXPECT_LT(StepOf(rule.get(), problem.At(minimizer)).norm(), 1e-12);
  problem.A.setZero();
  EXPECT_EQ(StepOf(rule.get(), problem.At(minimizer)).norm(), 0.0);
  problem.b.setZero();
  EXPECT_EQ(StepOf(rule.get(), problem.At(minimizer)).norm(), 0.0);
}

// A loss without a finite value but at x: the damping stays for the next step.
TEST(GeodesicRule, NoFiniteLossElsewhereIsNoStep) {
  const Parabola problem = MakeParabola(4, 3, 0.0);
  Linearization at_x = problem.At(VectorXd::Ones(3));
  at_x.after = [](const auto&, const auto&, auto*, auto*) { return false; };
  const auto rule = MakeRule("geodesic");
  EXPECT_EQ(StepOf(rule.get(), at_x).norm(), 0.0);
  EXPECT_EQ((*rule->MutableState()[0])[0], 1e-3);
  EXPECT_EQ(rule->LastStepReport(), "no step lowers the loss");
}

TEST(GeodesicRule, NamesWhatIsNotFinite) {
  const Parabola problem = MakeParabola(4, 3, 0.0);
  const auto rule = MakeRule("geodesic");
  VectorXd step;
  std::string error;
  Linearization at_x = problem.At(VectorXd::Ones(3));
  at_x.loss_gradient[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error,
            "the gradient of the loss in y is not finite: entry 2 is nan");
  at_x = problem.At(VectorXd::Ones(3));
  MatrixXd J = problem.A;
  J(1, 1) = std::numeric_limits<double>::infinity();
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error, "the Jacobian is not finite");
  at_x = problem.At(VectorXd::Ones(3));
  at_x.after = nullptr;
  EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error, "this loop cannot evaluate the loss at other points");
}

}  // namespace geodesic_rule_test
}  // namespace invgrad
