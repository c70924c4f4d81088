// Exact Hessians of problems.

#include <string>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/second_order_cost_function.h"
#include "tests/ceres/mixed_problem.h"

namespace invgrad {
namespace problem_linearizer_hessian_test {

// The blocks whose Plus is linear, robust losses included.
struct LinearPlus {
  double x[2] = {0.3, -0.8};
  double s[3] = {1.1, -0.2, 0.6};
  double y[2] = {0.4, 0.9};
  double constant[2] = {0.9, 0.2};
  ceres::Problem problem;

  explicit LinearPlus(double scale) {
    problem.AddParameterBlock(x, 2);
    problem.AddParameterBlock(y, 2, new ceres::EuclideanManifold<2>);
    problem.AddParameterBlock(s, 3, new ceres::SubsetManifold(3, {1}));
    problem.AddResidualBlock(NewMix<2, 3>(scale), nullptr, x, s);
    problem.AddResidualBlock(
        NewMix<3, 2>(scale), new ceres::HuberLoss(1.0), s, y);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::CauchyLoss(1.0), y, x);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::TukeyLoss(4.0), constant, x);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::TolerantLoss(1.0, 0.5), x, constant);
    // No Hessian can be asked of this one, and none is needed.
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Root, 1, 2>(new Root),
        nullptr,
        constant);
    problem.SetParameterBlockConstant(constant);
  }
};

TEST(ProblemLinearizer, HessianIsTheDerivativeOfTheGradient) {
  for (const double scale : {0.1, 1.0, 30.0}) {
    SCOPED_TRACE(scale);
    LinearPlus p(scale);
    ProblemLinearizer linearizer(&p.problem, {});
    const int n = linearizer.num_parameters();
    ASSERT_EQ(n, 6);
    LinearizationParts parts;
    parts.hessian = true;
    Linearization at_x;
    std::string error;
    ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;

    parts.hessian = false;
    parts.gradient = true;
    const Eigen::VectorXd state = linearizer.State();
    constexpr double kStep = 1e-5;
    Eigen::MatrixXd expected(n, n);
    for (int i = 0; i < n; ++i) {
      Linearization ahead;
      Linearization behind;
      Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
      step[i] = kStep;
      ASSERT_TRUE(linearizer.Plus(step));
      ASSERT_TRUE(linearizer.Linearize(parts, &ahead, &error));
      linearizer.SetState(state);
      ASSERT_TRUE(linearizer.Plus(-step));
      ASSERT_TRUE(linearizer.Linearize(parts, &behind, &error));
      linearizer.SetState(state);
      expected.col(i) = (ahead.gradient - behind.gradient) / (2.0 * kStep);
    }
    // Truncation h^2/6 times a fourth derivative (below 1e3 relative to the
    // Hessian), rounding epsilon / h: both below 1e-7.
    EXPECT_LT((at_x.hessian - expected).norm(), 1e-7 * expected.norm());
    EXPECT_LT((at_x.hessian - at_x.hessian.transpose()).norm(),
              1e-14 * expected.norm());
  }
}

std::string HessianError(ceres::Problem* problem) {
  ProblemLinearizer linearizer(problem, {});
  LinearizationParts parts;
  parts.hessian = true;
  Linearization at_x;
  std::string error;
  return linearizer.Linearize(parts, &at_x, &error) ? "" : error;
}

TEST(ProblemLinearizer, HessianNeedsSecondOrderCostFunctions) {
  LinearPlus p(1.0);
  EXPECT_EQ(HessianError(&p.problem), "");
  p.problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 2>(new Root), nullptr, p.x);
  const std::string error = HessianError(&p.problem);
  EXPECT_NE(error.find("residual block 6"), std::string::npos) << error;
  EXPECT_NE(error.find("AutoDiffSecondOrderCostFunction"), std::string::npos);
}

TEST(ProblemLinearizer, HessianRefusesACurvedPlus) {
  // At the identity, where the PlusJacobian of the quaternions has the same
  // entries as that of a subset.
  double q[4] = {1.0, 0.0, 0.0, 0.0};
  double x[2] = {0.3, -0.8};
  ceres::Problem problem;
  problem.AddResidualBlock(NewMix<2, 4>(1.0), nullptr, x, q);
  EXPECT_EQ(HessianError(&problem), "");
  problem.SetManifold(q, new ceres::QuaternionManifold);
  const std::string error = HessianError(&problem);
  EXPECT_NE(error.find("residual block 0"), std::string::npos) << error;
  EXPECT_NE(error.find("parameter block 1"), std::string::npos) << error;
  // What is linear in another guise is accepted, whatever its scale.
  x[0] = 1e6;
  problem.SetManifold(
      q,
      new ceres::ProductManifold<ceres::EuclideanManifold<2>,
                                 ceres::SubsetManifold>(
          ceres::EuclideanManifold<2>(), ceres::SubsetManifold(2, {0})));
  problem.SetManifold(x, new ceres::EuclideanManifold<2>);
  EXPECT_EQ(HessianError(&problem), "");
}

}  // namespace problem_linearizer_hessian_test
}  // namespace invgrad
