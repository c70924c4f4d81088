// Where a solve with proposals ends: at minima, not where a tolerance is met by
// accident; and what its summary says of other ends and of invalid starts.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/autodiff_manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/minimize.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/support/parse_method.h"

namespace invgrad {
namespace false_convergence_test {

struct Outcome {
  ceres::Solver::Summary solver;
  UpdateCallback::Summary proposals;
};

Outcome Solve(const std::string& rule_name,
              ceres::Problem* problem,
              const UpdateCallback::Options& callback_options = {}) {
  const std::unique_ptr<UpdateRule> rule = MakeRule(rule_name);
  EXPECT_NE(rule, nullptr);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  Outcome outcome;
  UpdateCallback callback(rule.get(), problem, callback_options);
  callback.AddTo(&options);
  ceres::Solve(options, problem, &outcome.solver);
  outcome.proposals = callback.summary();
  return outcome;
}

// y = a exp(b t)
struct Exponential {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    using std::exp;
    residual[0] = x[0] * exp(x[1] * t) - y;
    return true;
  }
  double t;
  double y;
};

// From (1, 1) Ceres ends at (2998, -16), and at (2e-8, 0.99), "converged".
TEST(FalseConvergence, ToleranceFarFromAMinimumDoesNotEndTheSolve) {
  for (const char* rule : {"half_inverse:step_size=auto:rho=1", "adaptive"}) {
    for (const Eigen::Vector2d& truth :
         {Eigen::Vector2d(3000.0, 0.1), Eigen::Vector2d(1.0, -1.0)}) {
      SCOPED_TRACE(testing::Message() << rule << ' ' << truth.transpose());
      Eigen::Vector2d x(1.0, 1.0);
      ceres::Problem problem;
      for (int i = 0; i <= 10; ++i) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Exponential, 1, 2>(
                new Exponential{1.0 * i, truth[0] * std::exp(truth[1] * i)}),
            nullptr,
            x.data());
      }
      const Outcome outcome = Solve(rule, &problem);
      EXPECT_LE((x - truth).cwiseQuotient(truth).norm(), 1e-5)
          << x.transpose() << outcome.solver.FullReport();
      EXPECT_EQ(outcome.proposals.predicted_decrease, 0.0);
    }
  }
}

// y = exp(log_a + b t)
struct LogarithmicExponential {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    using std::exp;
    residual[0] = exp(x[0] + x[1] * t) - y;
    return true;
  }
  double t;
  double y;
};

// Residuals of a small unit meet Ceres' gradient tolerance at the start.
TEST(FalseConvergence, AGradientBelowTheToleranceMayBeNoMinimum) {
  for (const char* method : {"ceres_lm", "ceres_lm+geodesic", "geodesic"}) {
    Eigen::Vector2d x(-20.2, -0.2);
    ceres::Problem problem;
    for (int i = 0; i < 10; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<LogarithmicExponential, 1, 2>(
              new LogarithmicExponential{1.0 * i, 2e-9 * std::exp(-0.3 * i)}),
          nullptr,
          x.data());
    }
    MinimizerSummary summary;
    std::string error;
    ASSERT_TRUE(MinimizeProblem(
        ParseMethod(method), {}, nullptr, &problem, &summary, &error))
        << error;
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_NE(summary.message.find("; no minimum: the linear model predicts "
                                   "that the cost falls by 99 %"),
              std::string::npos)
        << summary.message;
  }
}

// Angles in [-pi, pi) by Plus, as in Ceres' example: its gradient x - Plus(x, -g)
// is 2 pi at x = pi.
constexpr double kPi = 3.14159265358979323846;

struct Wrap {
  template <typename T>
  static T InOneTurn(const T& angle) {
    using std::floor;
    return angle - 2.0 * kPi * floor((angle + kPi) / (2.0 * kPi));
  }
  template <typename T>
  bool Plus(const T* x, const T* delta, T* sum) const {
    *sum = InOneTurn(T(*x + *delta));
    return true;
  }
  template <typename T>
  bool Minus(const T* y, const T* x, T* difference) const {
    *difference = InOneTurn(T(*y - *x));
    return true;
  }
};

struct StandsStill {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    r[0] = Wrap::InOneTurn(T(b[0] - a[0]));
    return true;
  }
};

TEST(FalseConvergence, AMinimumAtTheSeamOfAnAngleIsConvergence) {
  for (const double heading : {kPi, 3.0, -kPi}) {
    SCOPED_TRACE(heading);
    std::vector<double> angles(3, heading);
    ceres::Problem problem;
    for (double& angle : angles) {
      problem.AddParameterBlock(
          &angle, 1, new ceres::AutoDiffManifold<Wrap, 1, 1>);
    }
    for (int i = 0; i < 2; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<StandsStill, 1, 1, 1>(
              new StandsStill),
          nullptr,
          &angles[i],
          &angles[i + 1]);
    }
    problem.SetParameterBlockConstant(angles.data());
    const Outcome outcome =
        Solve("half_inverse:step_size=auto:rho=1", &problem);
    EXPECT_TRUE(outcome.solver.IsSolutionUsable())
        << outcome.solver.FullReport();
    EXPECT_TRUE(outcome.solver.termination_type == ceres::CONVERGENCE ||
                outcome.proposals.has_converged)
        << outcome.solver.FullReport();
    EXPECT_EQ(outcome.solver.final_cost, 0.0);
  }
}

// r = log(b[0] + b[1] t)
struct Log {
  template <typename T>
  bool operator()(const T* b, T* r) const {
    using std::log;
    const T sum = b[0] + t * b[1];
    if (sum <= 0.0) return false;
    r[0] = log(sum);
    return true;
  }
  double t;
};

TEST(FalseConvergence, AnInvalidStartIsNamedByResidualBlockAndParameter) {
  double b[2] = {1.0, -0.25};
  ceres::Problem problem;
  for (int i = 0; i < 8; ++i) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Log, 1, 2>(new Log{1.0 * i}),
        nullptr,
        b);
  }
  UpdateCallback::Options options;
  options.block_name = [](const double*) { return "b"; };
  const Outcome outcome =
      Solve("half_inverse:step_size=auto:rho=1", &problem, options);
  EXPECT_EQ(outcome.solver.termination_type, ceres::FAILURE);
  ASSERT_TRUE(outcome.proposals.first_outside_domain.has_value());
  EXPECT_EQ(outcome.proposals.first_outside_domain->ToText(),
            "the start: residual block 4 (cost function returned false): "
            "parameter `b`[0] = 1 (valid at 2); 3 other residual blocks fail, "
            "too");
  EXPECT_NE(outcome.proposals.BriefReport().find("the start: "),
            std::string::npos)
      << outcome.proposals.BriefReport();
  EXPECT_EQ(b[1], -0.25);
  // No remark on a start with a value.
  b[1] = 0.5;
  const Outcome other = Solve("half_inverse:step_size=auto:rho=1", &problem);
  EXPECT_TRUE(!other.proposals.first_outside_domain.has_value() ||
              !other.proposals.first_outside_domain->is_start);
}

struct Counted {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    ++*num_calls;
    r[0] = x[0];
    return is_valid;
  }
  int* num_calls;
  bool is_valid;
};

// Other values are tried in the failing residual block alone.
TEST(FalseConvergence, AnInvalidStartIsExplainedInOnePass) {
  constexpr int kNumValid = 100;
  std::vector<double> x(kNumValid, 2.0);
  double y[20];
  std::fill_n(y, 20, 2.0);
  int num_calls = 0;
  int num_failing_calls = 0;
  ceres::Problem problem;
  for (double& value : x) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Counted, 1, 1>(
                                 new Counted{&num_calls, true}),
                             nullptr,
                             &value);
  }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Counted, 1, 20>(
                               new Counted{&num_failing_calls, false}),
                           nullptr,
                           y);
  const std::unique_ptr<UpdateRule> rule = MakeRule("krylov");
  UpdateCallback callback(rule.get(), &problem);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  ASSERT_EQ(summary.termination_type, ceres::FAILURE);
  num_calls = 0;
  num_failing_calls = 0;
  const auto failure = callback.summary().first_outside_domain;
  ASSERT_TRUE(failure.has_value());
  EXPECT_EQ(failure->residual_block, kNumValid);
  EXPECT_TRUE(failure->parameters.empty());
  EXPECT_EQ(num_calls, kNumValid);
  EXPECT_LE(num_failing_calls, 3 + 20 * 16);
  EXPECT_EQ(y[0], 2.0);
}

}  // namespace false_convergence_test
}  // namespace invgrad
