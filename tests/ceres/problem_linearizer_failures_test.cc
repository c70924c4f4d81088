// Where a problem cannot be linearized, and the residual block that is named.

#include <algorithm>
#include <cmath>
#include <string>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "tests/ceres/mixed_problem.h"

namespace invgrad {
namespace problem_linearizer_failures_test {

// A Plus that fails leaves every block as it was.
class FailingManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 3; }
  int TangentSize() const override { return 1; }
  bool Plus(const double*, const double*, double* y) const override {
    y[0] = -1.0;
    return false;
  }
  // Ceres asks for one when the manifold is set, and insists on it.
  bool PlusJacobian(const double*, double* jacobian) const override {
    std::fill_n(jacobian, 3, 1.0);
    return num_calls++ == 0;
  }
  bool Minus(const double*, const double*, double*) const override {
    return false;
  }
  bool MinusJacobian(const double*, double*) const override { return false; }

  mutable int num_calls = 0;
};

TEST(ProblemLinearizer, FailingManifold) {
  Blocks blocks;
  ceres::Problem problem;
  problem.AddParameterBlock(blocks.x, 2);
  problem.AddParameterBlock(blocks.s, 3, new FailingManifold);
  problem.AddResidualBlock(NewMix<2, 3>(1.0), nullptr, blocks.x, blocks.s);
  ProblemLinearizer linearizer(&problem, {});
  const Eigen::VectorXd state = linearizer.State();
  EXPECT_FALSE(linearizer.Plus(Eigen::VectorXd::Ones(3)));
  EXPECT_EQ(linearizer.State(), state);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  EXPECT_FALSE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_NE(error.find("PlusJacobian of parameter block 1"), std::string::npos)
      << error;
}

// Residuals of which one is told to misbehave.
struct Misbehaving {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = bad_value * x[0];
    return !fails;
  }
  double bad_value;
  bool fails;
};

std::string LinearizeError(double bad_value, bool fails) {
  double x = 1.0;
  double constant = 1.0;
  ceres::Problem problem;
  using CostFunction = ceres::AutoDiffCostFunction<Misbehaving, 1, 1>;
  problem.AddResidualBlock(
      new CostFunction(new Misbehaving{1.0, false}), nullptr, &constant);
  problem.AddResidualBlock(
      new CostFunction(new Misbehaving{1.0, false}), nullptr, &x);
  const ceres::ResidualBlockId bad = problem.AddResidualBlock(
      new CostFunction(new Misbehaving{bad_value, fails}), nullptr, &x);
  problem.SetParameterBlockConstant(&constant);
  ProblemLinearizer::Options options;
  options.residual_blocks = {bad};
  ProblemLinearizer linearizer(&problem, options);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  std::string cost_error;
  double cost = 0.0;
  const bool cost_ok = linearizer.Cost(&cost, &cost_error);
  const bool ok = linearizer.Linearize(parts, &at_x, &error);
  EXPECT_EQ(ok, cost_ok);
  EXPECT_EQ(error, cost_error);
  return ok ? "" : error;
}

// The index is that in the problem, not that in the mini-batch.
TEST(ProblemLinearizer, FailuresNameTheResidualBlock) {
  EXPECT_EQ(LinearizeError(1.0, false), "");
  EXPECT_EQ(LinearizeError(1.0, true),
            "residual block 2: the cost function returned false");
  EXPECT_EQ(LinearizeError(std::nan(""), false),
            "residual block 2: a residual is not finite");
  // 1e200 is finite, its square is not.
  EXPECT_EQ(LinearizeError(1e200, false),
            "residual block 2: the cost is not finite");
}

TEST(ProblemLinearizer, JacobianNotFinite) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &x);
  ProblemLinearizer linearizer(&problem, {});
  LinearizationParts parts;
  Linearization at_x;
  std::string error;
  EXPECT_TRUE(linearizer.Linearize(parts, &at_x, &error));
  parts.gradient = true;
  EXPECT_FALSE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_NE(error.find("residual block 0"), std::string::npos) << error;
}

}  // namespace problem_linearizer_failures_test
}  // namespace invgrad
