// UpdateCallback::Options::only_proposals.
#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/support/function_rule.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace only_proposals_test {

constexpr double kAngle = 0.2;

// The distance from a wall along (cos, sin), which is `measured`.
struct Wall {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = -std::sin(kAngle) * x[0] + std::cos(kAngle) * x[1] - measured;
    return true;
  }
  double measured;
};

// A position between two walls; it solves them with a position 0.1 m away.
struct Corridor {
  Corridor() {
    for (const double measured : {0.1, 0.1}) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Wall, 1, 2>(new Wall{measured}),
          nullptr,
          x.data());
    }
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = ceres::DENSE_QR;
  }
  double Along() const {
    return std::cos(kAngle) * x[0] + std::sin(kAngle) * x[1];
  }
  double Across() const {
    return -std::sin(kAngle) * x[0] + std::cos(kAngle) * x[1];
  }

  Eigen::Vector2d x{0.0, 0.0};
  ceres::Problem problem;
  ceres::Solver::Options options;
  ceres::Solver::Summary summary;
};

class ReportCollector final : public ceres::IterationCallback {
 public:
  explicit ReportCollector(const UpdateRule& rule) : rule_(rule) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary&) override {
    reports.push_back(rule_.LastStepReport());
    return ceres::SOLVER_CONTINUE;
  }
  std::vector<std::string> reports;

 private:
  const UpdateRule& rule_;
};

// Levenberg-Marquardt scales columns one by one, and drifts along the corridor;
// the rule does not.
TEST(OnlyProposals, LeaveTheCorridorAlone) {
  Corridor plain;
  ceres::Solve(plain.options, &plain.problem, &plain.summary);
  EXPECT_NEAR(plain.Across(), 0.1, 1e-4);
  EXPECT_NEAR(std::abs(plain.Along()), 0.1 / std::tan(2.0 * kAngle), 1e-2);

  Corridor corridor;
  const auto rule = MakeRule("determined:groups=blocks");
  UpdateCallback::Options options;
  options.only_proposals = true;
  UpdateCallback callback(rule.get(), &corridor.problem, options);
  callback.AddTo(&corridor.options);
  ReportCollector collector(*rule);
  corridor.options.callbacks.push_back(&collector);
  ceres::Solve(corridor.options, &corridor.problem, &corridor.summary);
  EXPECT_EQ(corridor.summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_NEAR(corridor.Across(), 0.1, 1e-12);
  EXPECT_NEAR(corridor.Along(), 0.0, 1e-12);
  EXPECT_EQ(callback.summary().num_ceres_steps, 0);
  EXPECT_EQ(callback.summary().num_accepted, 1);
  ASSERT_GE(collector.reports.size(), 1u);
  EXPECT_EQ(collector.reports[0].substr(0, 18), "1 of 2 left alone:");
}

TEST(OnlyProposals, EndWhereTheRuleHasNoStep) {
  Corridor corridor;
  FunctionRule rule([](const auto&, auto*, std::string* error) {
    *error = "declined";
    return false;
  });
  UpdateCallback::Options options;
  options.only_proposals = true;
  UpdateCallback callback(&rule, &corridor.problem, options);
  callback.AddTo(&corridor.options);
  ceres::Solve(corridor.options, &corridor.problem, &corridor.summary);
  EXPECT_EQ(corridor.summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(callback.summary().message, "declined");
  EXPECT_TRUE(corridor.x.isZero(0.0));
}

// A line through noisy points.
struct Line {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] + x[1] * t - y;
    return true;
  }
  double t;
  double y;
};

// The first step of a linear problem is exact. With the default no step is made
// where the cost falls by less than 1e-3 of it: 0.01 is a standard error.
TEST(OnlyProposals, ReachTheMinimumOfALinearProblem) {
  constexpr int kNumPoints = 2000;
  for (const double off : {1.0, 0.01}) {
    NumpyRandom random(1);
    Eigen::MatrixXd A(kNumPoints, 2);
    Eigen::VectorXd y = 0.5 * random.Normal(kNumPoints);
    for (int i = 0; i < kNumPoints; ++i) {
      A.row(i) << 1.0, random.Uniform(-1.0, 1.0);
    }
    y += A * Eigen::Vector2d(1.0, 2.0);
    const Eigen::Vector2d best = LeastSquares(A, y);
    Eigen::Vector2d x = best + Eigen::Vector2d(off, 0.0);
    ceres::Problem problem;
    for (int i = 0; i < kNumPoints; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Line, 1, 2>(new Line{A(i, 1), y[i]}),
          nullptr,
          x.data());
    }
    const auto rule = MakeRule("determined");
    UpdateCallback::Options options;
    options.only_proposals = true;
    if (off < 0.1) options.min_relative_model_decrease = 1e-6;
    UpdateCallback callback(rule.get(), &problem, options);
    ceres::Solver::Options solver_options;
    solver_options.logging_type = ceres::SILENT;
    callback.AddTo(&solver_options);
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem, &summary);
    EXPECT_TRUE(summary.IsSolutionUsable()) << summary.message;
    EXPECT_EQ(callback.summary().num_accepted, 1);
    EXPECT_EQ(callback.summary().num_withheld, 0);
    EXPECT_LE((x - best).norm(), 1e-10);
  }
}

}  // namespace only_proposals_test
}  // namespace invgrad
