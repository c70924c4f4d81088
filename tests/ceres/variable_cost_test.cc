// Residual blocks whose parameter blocks are all constant change nothing about
// a solve with proposals.
#include <cmath>
#include <string>

#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace variable_cost_test {

struct Itself {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0];
    return true;
  }
};

// Rosenbrock's function and a constant residual.
struct WithFixed {
  explicit WithFixed(double residual, ceres::LossFunction* loss = nullptr)
      : fixed(residual) {
    rosenbrock.problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Itself, 1, 1>(new Itself),
        loss,
        &fixed);
    rosenbrock.problem.SetParameterBlockConstant(&fixed);
  }
  double Distance() const {
    return std::hypot(rosenbrock.x[0] - 1.0, rosenbrock.x[1] - 1.0);
  }

  double fixed;
  RosenbrockProblem rosenbrock;
};

ceres::Solver::Options DenseOptions() {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  return options;
}

UpdateCallback::Summary SolveWithGeodesic(
    const UpdateCallback::Options& callback_options, WithFixed* p) {
  const auto rule = MakeRule("geodesic");
  ceres::Solver::Options options = DenseOptions();
  UpdateCallback callback(rule.get(), &p->rosenbrock.problem, callback_options);
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p->rosenbrock.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
  return callback.summary();
}

TEST(VariableCost, ALargeFixedCostDoesNotEndTheSolveEarlier) {
  for (const double residual : {1e2, 1e4, 1e6}) {
    for (const bool has_loss : {false, true}) {
      const auto loss = [&]() -> ceres::LossFunction* {
        return has_loss ? new ceres::HuberLoss(1.0) : nullptr;
      };
      SCOPED_TRACE(residual);
      WithFixed plain(residual, loss());
      ceres::Solver::Summary summary;
      ceres::Solve(DenseOptions(), &plain.rosenbrock.problem, &summary);
      ASSERT_LE(plain.Distance(), 1e-7);
      WithFixed p(residual, loss());
      SolveWithGeodesic({}, &p);
      EXPECT_LE(p.Distance(), 1e-7);
    }
  }
}

TEST(VariableCost, ALargeFixedCostDoesNotEndProposals) {
  UpdateCallback::Options options;
  options.compare_with_plain = false;
  options.max_relative_work = 1e9;
  for (const double residual : {0.0, 1e2, 1e6}) {
    SCOPED_TRACE(residual);
    WithFixed p(residual);
    EXPECT_GE(SolveWithGeodesic(options, &p).num_accepted, 3);
    EXPECT_LE(p.Distance(), 1e-9);
  }
}

TEST(VariableCost, FixedResidualBlocksAreLeftOutOnRequest) {
  WithFixed p(3.0, new ceres::HuberLoss(1.0));
  for (const bool leave_out : {false, true}) {
    ProblemLinearizer::Options options;
    options.leave_out_fixed = leave_out;
    const ProblemLinearizer linearizer(&p.rosenbrock.problem, options);
    Linearization at_x;
    std::string error;
    ASSERT_TRUE(
        linearizer.Linearize(LinearizationParts::Jacobian(), &at_x, &error))
        << error;
    // L = 1/2 (2.2^2 + 4.4^2), and Huber's 1/2 (2 * 3 - 1)
    EXPECT_NEAR(at_x.cost, leave_out ? 12.1 : 14.6, 1e-12);
    ASSERT_EQ(at_x.loss_gradient.size(), 3);
    EXPECT_EQ(at_x.loss_gradient[2] == 0.0, leave_out);
    double cost = 0.0;
    ASSERT_TRUE(linearizer.Cost(&cost, &error)) << error;
    EXPECT_EQ(cost, at_x.cost);
  }
}

}  // namespace variable_cost_test
}  // namespace invgrad
