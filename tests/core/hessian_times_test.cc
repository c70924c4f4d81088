#include "invgrad/core/hessian_times.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/internal/objective.h"
#include "invgrad/second_order_cost_function.h"
#include "tests/support/random_matrix.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace hessian_times_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearizationParts Products() {
  LinearizationParts parts;
  parts.hessian_times = true;
  return parts;
}

// H v of L = scale^2 sum_i cosh((x_i - c_i) / scale), whose Hessian is
// diag(cosh).
TEST(HessianTimes, HasTheErrorOfCentralDifferencesForUnknownsOfAnySize) {
  for (const double scale : {1.0, 1e3, 1e6}) {
    const VectorXd x = scale * RandomMatrix(6, 1, 1);
    const VectorXd c = scale * RandomMatrix(6, 1, 2);
    Linearization at_x;
    AddProductsAndTrials(
        Products(),
        x,
        [&](const VectorXd& step, auto&, Linearization* after, auto*) {
          after->gradient = scale * ((x + step - c) / scale).array().sinh();
          return true;
        },
        &at_x);
    for (const double length : {1e-3, 1.0, 1e5}) {
      const VectorXd v = length * RandomMatrix(6, 1, 3);
      const VectorXd expected = ((x - c) / scale).array().cosh() * v.array();
      VectorXd Hv;
      std::string error;
      ASSERT_TRUE(at_x.hessian_times(v, &Hv, &error)) << error;
      EXPECT_LE((Hv - expected).norm(), 1e-9 * expected.norm());
    }
    VectorXd Hv;
    std::string error;
    ASSERT_TRUE(at_x.hessian_times(VectorXd::Zero(6), &Hv, &error));
    EXPECT_EQ(Hv, VectorXd(VectorXd::Zero(6)));
  }
}

TEST(HessianTimes, AgreesWithTheExactHessianOfAProblemThatItLeavesInPlace) {
  RosenbrockProblem p(
      new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock));
  ProblemLinearizer linearizer(&p.problem, {});
  LinearizationParts parts;
  parts.hessian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
  AddProductsAndTrials(
      Products(), linearizer.State(), AfterOf(&linearizer), &at_x);
  const VectorXd state = linearizer.State();
  const Eigen::Vector2d v(0.3, -2.0);
  VectorXd Hv;
  ASSERT_TRUE(at_x.hessian_times(v, &Hv, &error)) << error;
  EXPECT_EQ(linearizer.State(), state);
  const VectorXd expected = at_x.hessian * v;
  EXPECT_LE((Hv - expected).norm(), 1e-8 * expected.norm());
}

TEST(HessianTimes, KeepsTheProductOfTheObjective) {
  RosenbrockProblem p;
  ProblemLinearizer linearizer(&p.problem, {});
  Linearization at_x;
  at_x.hessian_times = [](const auto& v, auto* Hv, auto*) {
    *Hv = 3.0 * v;
    return true;
  };
  AddProductsAndTrials(
      Products(), linearizer.State(), AfterOf(&linearizer), &at_x);
  VectorXd Hv;
  std::string error;
  ASSERT_TRUE(at_x.hessian_times(VectorXd::Ones(2), &Hv, &error));
  EXPECT_EQ(Hv, VectorXd(VectorXd::Constant(2, 3.0)));
}

TEST(HessianTimes, ReportsWhatFails) {
  Linearization at_x;
  VectorXd Hv;
  std::string error;
  AddProductsAndTrials(
      Products(),
      VectorXd::Zero(2),
      [](const VectorXd&, auto&, Linearization*, std::string* why) {
        *why = "no gradient here";
        return false;
      },
      &at_x);
  EXPECT_FALSE(at_x.hessian_times(VectorXd::Ones(2), &Hv, &error));
  EXPECT_EQ(error, "no gradient here");
  Linearization at_infinity;
  AddProductsAndTrials(
      Products(),
      VectorXd::Zero(2),
      [](const VectorXd& step, auto&, Linearization* after, auto*) {
        after->gradient = step * std::numeric_limits<double>::infinity();
        return true;
      },
      &at_infinity);
  EXPECT_FALSE(at_infinity.hessian_times(VectorXd::Ones(2), &Hv, &error));
  EXPECT_EQ(error,
            "the product with the Hessian is not finite: entry 0 is inf");
}

TEST(LinearizeAfter, IsTheLinearizationThereAndMovesBack) {
  RosenbrockProblem p;
  ProblemLinearizer linearizer(&p.problem, {});
  const VectorXd state = linearizer.State();
  LinearizationParts parts;
  parts.after = true;
  Linearization at_x, after, expected;
  AddProductsAndTrials(parts, state, AfterOf(&linearizer), &at_x);
  EXPECT_FALSE(at_x.hessian_times);
  const Eigen::Vector2d step(0.3, -0.2);
  std::string error;
  ASSERT_TRUE(
      at_x.after(step, LinearizationParts::LossGradient(), &after, &error));
  EXPECT_EQ(linearizer.State(), state);
  ASSERT_TRUE(linearizer.Plus(step));
  ASSERT_TRUE(
      linearizer.Linearize(LinearizationParts::Jacobian(), &expected, &error));
  EXPECT_EQ(after.cost, expected.cost);
  EXPECT_EQ(after.loss_gradient, expected.loss_gradient);
  EXPECT_EQ(after.jacobian, nullptr);
  EXPECT_FALSE(AfterOf(&linearizer)(
      Eigen::Vector2d::Constant(1e300), parts, &after, &error));
}

}  // namespace hessian_times_test
}  // namespace invgrad
