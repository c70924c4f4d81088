#include "invgrad/minimize/minimizer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "Eigen/QR"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "ceres/sized_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/autodiff_second_order_cost_function.h"
#include "invgrad/rules/rules.h"

namespace invgrad {
namespace minimizer_test {

// A rule made of a function.
class FunctionRule final : public UpdateRule {
 public:
  using Function = std::function<bool(
      const Linearization& at_x, Eigen::VectorXd* step, std::string* error)>;
  FunctionRule(LinearizationParts needs, Function function)
      : needs_(needs), function_(std::move(function)) {}
  LinearizationParts Needs() const override { return needs_; }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    return function_(at_x, step, error);
  }

 private:
  LinearizationParts needs_;
  Function function_;
};

LinearizationParts Needs(bool gradient, bool jacobian, bool hessian) {
  LinearizationParts parts;
  parts.gradient = gradient;
  parts.jacobian = jacobian;
  parts.hessian = hessian;
  return parts;
}

FunctionRule GradientDescent(double step_size) {
  return {Needs(true, false, false),
          [step_size](const auto& at_x, auto* step, std::string*) {
            *step = -step_size * at_x.gradient;
            return true;
          }};
}

FunctionRule GaussNewton() {
  return {Needs(false, true, false),
          [](const auto& at_x, auto* step, std::string*) {
            Eigen::MatrixXd J;
            at_x.jacobian->ToDense(&J);
            *step = -J.householderQr().solve(at_x.loss_gradient);
            return true;
          }};
}

FunctionRule Newton() {
  return {Needs(true, false, true),
          [](const auto& at_x, auto* step, std::string*) {
            *step = -at_x.hessian.ldlt().solve(at_x.gradient);
            return true;
          }};
}

// r = factor (x - target), the minimum is at `target`.
struct Offset {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = factor * (x[0] - target);
    return true;
  }
  double factor;
  double target;
};

struct Line {
  double x = 3.0;
  ceres::Problem problem;
  ceres::ResidualBlockId Add(double factor, double target) {
    return problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Offset, 1, 1>(
            new Offset{factor, target}),
        nullptr,
        &x);
  }
};

MinimizerOptions NoTolerances(int max_num_iterations) {
  MinimizerOptions options;
  options.max_num_iterations = max_num_iterations;
  options.gradient_tolerance = 0.0;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  return options;
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

struct Rosenbrock {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = 1.0 - x[0];
    r[1] = 10.0 * (x[1] - x[0] * x[0]);
    return true;
  }
};

// Gauss-Newton solves Rosenbrock's function in two steps: the first makes r_0
// zero, the second r_1. Newton's method knows the Hessian.
TEST(Minimizer, Rosenbrock) {
  for (const bool is_newton : {false, true}) {
    double x[2] = {-1.2, 1.0};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
        nullptr,
        x);
    FunctionRule rule = is_newton ? Newton() : GaussNewton();
    MinimizerSummary summary;
    Minimize(MinimizerOptions(), &rule, &problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(x[0], 1.0, 1e-10);
    EXPECT_NEAR(x[1], 1.0, 1e-10);
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
  int num_taken_back = 0;
  for (const auto& [text, reduction] :
       {std::pair("gauss_newton:control=gain", 1e-2),
        std::pair("gauss_newton:step_size=2.5:control=gain", 1e-2),
        std::pair("gauss_newton:step_size=auto:control=gain", 1e-6),
        std::pair("levenberg_marquardt:control=gain", 1e-6),
        std::pair("half_inverse:control=gain", 1e-2),
        std::pair("power:kappa=0.75:step_size=4:control=gain", 1e-2),
        std::pair("adaptive_power", 1e-6),
        std::pair("adaptive_power:rho=1", 1e-6)}) {
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
      EXPECT_EQ(num_unsuccessful, summary.num_taken_back);
      num_taken_back += num_unsuccessful;
      EXPECT_LT(summary.final_cost, reduction * summary.initial_cost);
    }
  }
  EXPECT_GT(num_taken_back, 20);
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
class RefusingRule final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return minimizer_test::Needs(true, false, false);
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = -0.5 * at_x.gradient;
    return true;
  }
  bool JudgesSteps() const override { return true; }
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
  EXPECT_EQ(summary.num_taken_back, 2);
  EXPECT_FALSE(summary.iterations[1].step_is_successful);
  EXPECT_FALSE(summary.iterations[2].step_is_successful);
  EXPECT_TRUE(summary.iterations[3].step_is_successful);
  EXPECT_EQ(summary.message,
            "Maximum number of iterations reached. Number of iterations: 4; 2 "
            "steps taken back");
}

// Dennis and Schnabel, Numerical Methods (1996): the first Newton iterate from
// (-1.2, 1) is (-1.1752809, 1.3806742); the published digits.
TEST(Minimizer, FirstNewtonIterateOfRosenbrock) {
  double x[2] = {-1.2, 1.0};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
      nullptr,
      x);
  FunctionRule rule = Newton();
  MinimizerSummary summary;
  Minimize(NoTolerances(1), &rule, &problem, &summary);
  EXPECT_NEAR(x[0], -1.1752809, 1e-7);
  EXPECT_NEAR(x[1], 1.3806742, 1e-7);
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

TEST(Minimizer, GradientTolerance) {
  Line line;
  line.Add(1.0, 0.0);  // the gradient is x
  MinimizerOptions options = NoTolerances(100);
  options.gradient_tolerance = 0.75;  // reached exactly, by halving
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(line.x, 0.75);
  EXPECT_NE(summary.message.find("Gradient tolerance"), std::string::npos);

  // At the start there is nothing to do.
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
}

TEST(Minimizer, FunctionTolerance) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options = NoTolerances(7);
  // A step takes three quarters of the cost.
  options.function_tolerance = 0.74;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 7);
  options.function_tolerance = 0.75;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 1);
  EXPECT_NE(summary.message.find("Function tolerance"), std::string::npos);
}

TEST(Minimizer, ParameterTolerance) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options = NoTolerances(7);
  options.parameter_tolerance = 0.4;  // |step| = |x| / 2 until |x| <= 1.6
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 2);
  EXPECT_NE(summary.message.find("Parameter tolerance"), std::string::npos);
}

TEST(Minimizer, TimeBudget) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options;
  options.max_time_in_seconds = 0.0;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_NE(summary.message.find("time"), std::string::npos);
}

TEST(Minimizer, ProgressIsTheShareOfTheBudget) {
  Line line;
  line.Add(1.0, 0.0);
  std::vector<double> progress;
  FunctionRule rule(Needs(true, false, false),
                    [&](const auto& at_x, auto* step, std::string*) {
                      progress.push_back(at_x.progress);
                      *step = -0.5 * at_x.gradient;
                      return true;
                    });
  MinimizerSummary summary;
  Minimize(NoTolerances(4), &rule, &line.problem, &summary);
  // Exactly so, whatever the clock says.
  EXPECT_EQ(progress, std::vector<double>({0.0, 0.25, 0.5, 0.75}));

  progress.clear();
  MinimizerOptions options = NoTolerances(4);
  options.max_time_in_seconds = 100.0;
  Minimize(options, &rule, &line.problem, &summary);
  ASSERT_EQ(progress.size(), 4u);
  EXPECT_GT(progress[0], 0.0);
}

// Notes what it is shown and says `answer` at iteration `when`.
class Watcher final : public ceres::IterationCallback {
 public:
  Watcher(const double* x, int when, ceres::CallbackReturnType answer)
      : x_(x), when_(when), answer_(answer) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    states.push_back(*x_);
    return iteration.iteration == when_ ? answer_ : ceres::SOLVER_CONTINUE;
  }
  std::vector<double> states;

 private:
  const double* x_;
  int when_;
  ceres::CallbackReturnType answer_;
};

TEST(Minimizer, CallbacksSeeEveryState) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  Watcher continues(&line.x, 2, ceres::SOLVER_CONTINUE);
  Watcher aborts(&line.x, 2, ceres::SOLVER_ABORT);
  Watcher never_asked(&line.x, 0, ceres::SOLVER_CONTINUE);
  MinimizerOptions options = NoTolerances(10);
  options.callbacks = {&continues, &aborts, &never_asked};
  MinimizerSummary summary;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
  EXPECT_EQ(continues.states, std::vector<double>({3.0, 1.5, 0.75}));
  EXPECT_EQ(never_asked.states, std::vector<double>({3.0, 1.5}));
  EXPECT_EQ(line.x, 0.75);
  EXPECT_EQ(summary.num_steps(), 2);

  Watcher is_content(&line.x, 0, ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  options.callbacks = {&is_content};
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_EQ(line.x, 0.75);
}

// L = x^2 / 2, x_{k+1} = -1e100 x_k: the residual stays finite for three steps,
// its square only for one.
TEST(Minimizer, DivergenceEndsAtTheLastFiniteState) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(1e100);
  MinimizerSummary summary;
  Minimize(NoTolerances(10), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(summary.message,
            "iteration 2: residual block 0: the cost is not finite");
  EXPECT_DOUBLE_EQ(line.x, -3e100);
  EXPECT_DOUBLE_EQ(summary.final_cost, 4.5e200);
  EXPECT_EQ(summary.num_steps(), 1);
  EXPECT_TRUE(summary.iterations[1].step_is_nonmonotonic);
}

TEST(Minimizer, RuleFails) {
  for (const bool returns_nan : {false, true}) {
    Line line;
    line.Add(1.0, 0.0);
    FunctionRule rule(Needs(true, false, false),
                      [&](const auto& at_x, auto* step, std::string* error) {
                        *step = std::nan("") * at_x.gradient;
                        *error = "singular";
                        return returns_nan;
                      });
    MinimizerSummary summary;
    Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::FAILURE);
    EXPECT_EQ(summary.message,
              returns_nan ? "iteration 1: the step is not finite"
                          : "iteration 1: singular");
    EXPECT_EQ(line.x, 3.0);
    EXPECT_EQ(summary.final_cost, 4.5);
  }
}

TEST(Minimizer, BadStart) {
  Line line;
  line.x = std::numeric_limits<double>::infinity();
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_TRUE(summary.iterations.empty());
  EXPECT_NE(summary.message.find("residual block 0"), std::string::npos);
}

TEST(Minimizer, NothingToChange) {
  Line line;
  line.Add(1.0, 0.0);
  line.problem.SetParameterBlockConstant(&line.x);
  FunctionRule rule = GaussNewton();
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.final_cost, 4.5);
}

}  // namespace minimizer_test
}  // namespace invgrad
