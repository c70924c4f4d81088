#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/LU"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "ceres/sized_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/minimize.h"
#include "invgrad/rules.h"
#include "invgrad/second_order_cost_function.h"
#include "invgrad/update_rule.h"
#include "tests/minimize/parabola.h"
#include "tests/support/function_rule.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace minimizer_test {

FunctionRule Newton() {
  return {LinearizationParts{true, false, true},
          [](const auto& at_x, auto* step, std::string*) {
            *step = -at_x.hessian.lu().solve(at_x.gradient);
            return true;
          }};
}

TEST(Minimizer, GradientDescentOnAParabolaInClosedForm) {
  Line line;
  line.Add(2.0, 0.0);  // L = 2 x^2, gradient 4 x
  FunctionRule rule = GradientDescent(0.125);
  MinimizerSummary summary;
  Minimize(NoTolerances(5), &rule, &line.problem, &summary);

  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 5);
  EXPECT_EQ(line.x, 3.0 / 32.0);  // halved five times, exactly
  EXPECT_EQ(summary.initial_cost, 18.0);
  EXPECT_EQ(summary.final_cost, 2.0 * line.x * line.x);
  for (int k = 0; k <= 5; ++k) {
    const ceres::IterationSummary& iteration = summary.iterations[k];
    const double x = 3.0 * std::pow(0.5, k);
    EXPECT_EQ(iteration.iteration, k);
    EXPECT_EQ(iteration.cost, 2.0 * x * x);
    EXPECT_EQ(iteration.cost_change, k == 0 ? 0.0 : 6.0 * x * x);
    EXPECT_EQ(iteration.gradient_norm, 4.0 * x);
    EXPECT_EQ(iteration.gradient_max_norm, 4.0 * x);
    EXPECT_EQ(iteration.step_norm, k == 0 ? 0.0 : x);
    EXPECT_TRUE(iteration.step_is_valid);
    EXPECT_TRUE(iteration.step_is_successful);
    EXPECT_FALSE(iteration.step_is_nonmonotonic);
    EXPECT_GE(iteration.iteration_time_in_seconds, 0.0);
    EXPECT_GE(summary.total_time_in_seconds,
              iteration.cumulative_time_in_seconds);
  }
  EXPECT_EQ(summary.BriefReport(),
            "NO_CONVERGENCE, 5 steps, cost 1.800000e+01 -> 1.757812e-02: "
            "Maximum number of iterations reached. Number of iterations: 5");
}

// Gauss-Newton solves Rosenbrock's function in two steps: the first makes r_0
// zero, the second r_1. Newton's method knows the Hessian.
TEST(Minimizer, Rosenbrock) {
  for (const bool is_newton : {false, true}) {
    RosenbrockProblem p(
        new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock));
    FunctionRule rule = is_newton ? Newton() : GaussNewton();
    MinimizerSummary summary;
    Minimize(MinimizerOptions(), &rule, &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(p.x[0], 1.0, 1e-10);
    EXPECT_NEAR(p.x[1], 1.0, 1e-10);
    if (!is_newton) {
      EXPECT_EQ(summary.num_steps(), 2);
    }
  }
}

// Powell's singular function, whose J is singular at the minimum, 0.
struct Powell {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] + 10.0 * x[1];
    r[1] = std::sqrt(5.0) * (x[2] - x[3]);
    r[2] = (x[1] - 2.0 * x[2]) * (x[1] - 2.0 * x[2]);
    r[3] = std::sqrt(10.0) * (x[0] - x[3]) * (x[0] - x[3]);
    return true;
  }
};

// Steps that are too long for the function, and steps that are not. With a
// fixed step size a low exponent is slow in Rosenbrock's valley; those that
// find theirs arrive.
TEST(Minimizer, WithControlTheCostNeverRises) {
  int num_undone = 0;
  for (const auto& [text, reduction] :
       {std::pair("gauss_newton:control=gain", 1e-2),
        std::pair("gauss_newton:step_size=2.5:control=gain", 1e-2),
        std::pair("gauss_newton:step_size=auto:control=gain", 1e-6),
        std::pair("levenberg_marquardt:control=gain", 1e-6),
        std::pair("half_inverse:control=gain", 1e-2),
        std::pair("power:kappa=0.75:step_size=4:control=gain", 1e-2),
        std::pair("power:step_size=auto:control=gain", 1e-6),
        std::pair("power:step_size=auto:control=gain:rho=1", 1e-6),
        std::pair("hessian_free", 1e-6)}) {
    for (const bool is_powell : {false, true}) {
      SCOPED_TRACE(std::string(text) + (is_powell ? ", Powell" : ""));
      double x[4] = {-1.2, 1.0};
      ceres::Problem problem;
      if (is_powell) {
        const double start[4] = {3.0, -1.0, 0.0, 1.0};
        std::copy(start, start + 4, x);
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Powell, 4, 4>(new Powell),
            nullptr,
            x);
      } else {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
            nullptr,
            x);
      }
      const auto rule = MakeRule(text);
      MinimizerSummary summary;
      Minimize(NoTolerances(300), rule.get(), &problem, &summary);
      EXPECT_NE(summary.termination_type, ceres::FAILURE) << summary.message;
      int num_unsuccessful = 0;
      for (size_t k = 1; k < summary.iterations.size(); ++k) {
        const ceres::IterationSummary& iteration = summary.iterations[k];
        const double before = summary.iterations[k - 1].cost;
        EXPECT_LE(iteration.cost, before * (1.0 + 1e-13));
        if (!iteration.step_is_successful) {
          ++num_unsuccessful;
          EXPECT_EQ(iteration.cost, before);
          EXPECT_EQ(iteration.step_norm, 0.0);
          EXPECT_EQ(iteration.cost_change, 0.0);
        }
      }
      EXPECT_EQ(num_unsuccessful, summary.num_undone);
      num_undone += num_unsuccessful;
      EXPECT_LT(summary.final_cost, reduction * summary.initial_cost);
    }
  }
  EXPECT_GT(num_undone, 20);
}

// r = x, which counts its evaluations.
class CountingLine final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    ++num_evaluations;
    residuals[0] = parameters[0][0];
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1.0;
    return true;
  }
  mutable int num_evaluations = 0;
};

// Gradient descent that refuses its first two steps.
class RefusingRule final : public UpdateRule, public StepJudge {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -0.5 * at_x.gradient;
    return true;
  }
  StepJudge* judge() override { return this; }
  bool KeepsStep(double cost, double fraction) override {
    EXPECT_EQ(fraction, 1.0);
    costs.push_back(cost);
    return costs.size() > 2;
  }
  std::vector<double> costs;
};

TEST(Minimizer, ASteppedBackPointIsNotLinearizedAgain) {
  double x = 4.0;
  ceres::Problem problem;
  auto* line = new CountingLine;
  problem.AddResidualBlock(line, nullptr, &x);
  RefusingRule rule;
  MinimizerSummary summary;
  Minimize(NoTolerances(4), &rule, &problem, &summary);
  EXPECT_EQ(x, 1.0);
  EXPECT_EQ(rule.costs, std::vector<double>({2.0, 2.0, 2.0, 0.5}));
  // The start, and where each step led.
  EXPECT_EQ(line->num_evaluations, 5);
  EXPECT_EQ(summary.num_undone, 2);
  EXPECT_FALSE(summary.iterations[1].step_is_successful);
  EXPECT_FALSE(summary.iterations[2].step_is_successful);
  EXPECT_TRUE(summary.iterations[3].step_is_successful);
  EXPECT_EQ(summary.message,
            "Maximum number of iterations reached. Number of iterations: 4; 2 "
            "steps undone");
}

// Dennis and Schnabel, Numerical Methods (1996): the first Newton iterate from
// (-1.2, 1) is (-1.1752809, 1.3806742); the published digits.
TEST(Minimizer, FirstNewtonIterateOfRosenbrock) {
  RosenbrockProblem p(
      new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock));
  FunctionRule rule = Newton();
  MinimizerSummary summary;
  Minimize(NoTolerances(1), &rule, &p.problem, &summary);
  EXPECT_NEAR(p.x[0], -1.1752809, 1e-7);
  EXPECT_NEAR(p.x[1], 1.3806742, 1e-7);
}

// Finds the rotation that turns three axes: the step is in the tangent space.
struct RotationError {
  template <typename T>
  bool operator()(const T* q, T* r) const {
    const T point[3] = {T(1.0), T(2.0), T(-0.5)};
    const T other[3] = {T(-0.3), T(0.4), T(1.0)};
    T rotated[3];
    ceres::UnitQuaternionRotatePoint(q, point, rotated);
    for (int i = 0; i < 3; ++i) r[i] = rotated[i] - a[i];
    ceres::UnitQuaternionRotatePoint(q, other, rotated);
    for (int i = 0; i < 3; ++i) r[3 + i] = rotated[i] - b[i];
    return true;
  }
  double a[3];
  double b[3];
};

// As in ceres::Solve, only costs that can change decide; the summary has all.
TEST(Minimizer, AFixedCostDoesNotMeetTheTolerance) {
  RosenbrockProblem rosenbrock;
  double constant = 1e6;
  rosenbrock.problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset{1.0, 0.0}),
      nullptr,
      &constant);
  rosenbrock.problem.SetParameterBlockConstant(&constant);
  MinimizerSummary summary;
  Minimize(MinimizerOptions(),
           MakeRule("geodesic").get(),
           &rosenbrock.problem,
           &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(rosenbrock.x[0], 1.0, 1e-6);
  EXPECT_NEAR(rosenbrock.x[1], 1.0, 1e-6);
  EXPECT_EQ(summary.final_cost, 5e11);
  EXPECT_NEAR(summary.initial_cost, 5e11 + 12.1, 1e-3);
}

struct SquareMinusOne {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] - 1.0;
    return true;
  }
};

// L = 1/2 (x^2 - 1)^2 has L'' = 22 at x = 2, where differences over a length that
// suits the start, 1e6, would give another value.
TEST(Minimizer, ProductsWithTheHessianAreOfTheCurrentPoint) {
  double x = 1e6;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<SquareMinusOne, 1, 1>(new SquareMinusOne),
      nullptr,
      &x);
  LinearizationParts parts = LinearizationParts::Gradient();
  parts.hessian_times = true;
  Eigen::VectorXd Hv;
  FunctionRule rule(parts, [&](const auto& at_x, auto* step, auto* error) {
    *step = Eigen::VectorXd::Constant(1, 2.0 - x);
    return at_x.hessian_times(Eigen::VectorXd::Ones(1), &Hv, error);
  });
  MinimizerSummary summary;
  Minimize(NoTolerances(2), &rule, &problem, &summary);
  EXPECT_NEAR(Hv[0], 22.0, 1e-6);
}

TEST(Minimizer, Quaternion) {
  const double truth[4] = {0.5, -0.5, 0.1, 0.7};  // unit length
  const double point[3] = {1.0, 2.0, -0.5};
  const double other[3] = {-0.3, 0.4, 1.0};
  auto* error = new RotationError;
  ceres::UnitQuaternionRotatePoint(truth, point, error->a);
  ceres::UnitQuaternionRotatePoint(truth, other, error->b);
  double q[4] = {0.8, -0.4, 0.2, 0.4};
  ceres::Problem problem;
  problem.AddParameterBlock(q, 4, new ceres::QuaternionManifold);
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<RotationError, 6, 4>(error), nullptr, q);
  FunctionRule rule = GaussNewton();
  MinimizerSummary summary;
  MinimizerOptions options;
  options.function_tolerance = 0.0;
  options.gradient_tolerance = 1e-12;
  Minimize(options, &rule, &problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(q[i], truth[i], 1e-12);
}

TEST(Minimizer, MiniBatch) {
  Line line;
  line.Add(1.0, 100.0);
  const ceres::ResidualBlockId second = line.Add(1.0, -2.0);
  MinimizerOptions options;
  options.residual_blocks = {second};
  FunctionRule rule = GaussNewton();
  MinimizerSummary summary;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(line.x, -2.0);
  EXPECT_EQ(summary.initial_cost, 12.5);
}

}  // namespace minimizer_test
}  // namespace invgrad
