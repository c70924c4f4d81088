// What UpdateCallback does when Ceres rejects a proposal: shorter proposals, and
// longer ones again.

#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/update_callback.h"
#include "invgrad/update_rule.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/function_rule.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace update_callback_rejections_test {

using Options = UpdateCallback::Options;

// r = 1 / x - 1, which notes where it was evaluated.
class Pole final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const double x = parameters[0][0];
    states.push_back(x);
    residuals[0] = 1.0 / x - 1.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = -1.0 / (x * x);
    }
    return true;
  }
  mutable std::vector<double> states;
};

// A step that makes things worse is halved twice, and then it is Ceres' turn.
TEST(UpdateCallback, BacksOffThenLeavesToCeres) {
  double x = 0.5;
  ceres::Problem problem;
  auto* pole = new Pole;
  problem.AddResidualBlock(pole, nullptr, &x);
  int num_asked = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string* error) {
    *error = "asked once is enough";
    *step = Eigen::VectorXd::Constant(1, -0.75);
    return ++num_asked == 1;
  });
  Options options;
  options.min_relative_model_decrease = -1e300;
  options.compare_with_plain = false;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &problem, &summary);
  EXPECT_NEAR(x, 1.0, 1e-6);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_withheld, 3);
  EXPECT_EQ(counts.num_proposed, 0);
  EXPECT_GT(counts.num_ceres_steps, 0);
  EXPECT_EQ(counts.message, "asked once is enough");
  // Ceres' own steps go up from 0.5, the proposals down.
  std::vector<double> proposals;
  for (const double state : pole->states) {
    if (state < 0.5) proposals.push_back(state);
  }
  EXPECT_EQ(proposals, std::vector<double>({-0.25, 0.125, 0.3125}));
}

// From 0: +30 is rejected, +15 is accepted at scale 1/2, and the
// next proposal, -4, is taken whole.
TEST(UpdateCallback, TheScaleRecovers) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  int num_asked = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string*) {
    *step = Eigen::VectorXd::Constant(1, num_asked == 0 ? 30.0 : -4.0);
    return ++num_asked <= 2;
  });
  Options options;
  options.by_merit = false;
  options.compare_with_plain = false;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(nullptr);
  solver_options.max_num_iterations = 2;
  callback.AddTo(&solver_options);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(x, 11.0);
  EXPECT_EQ(callback.summary().num_accepted, 2);
  EXPECT_EQ(callback.summary().num_withheld, 1);
}

// Steps of `first`, and then of -4, that remembers what became of them.
class JudgingRule final : public UpdateRule, public StepJudge {
 public:
  explicit JudgingRule(double first) : first_(first) {}
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization&,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = Eigen::VectorXd::Constant(1, num_asked_ == 0 ? first_ : -4.0);
    return ++num_asked_ <= 2;
  }
  StepJudge* judge() override { return this; }
  bool KeepsStep(double cost, double fraction) override {
    judged.emplace_back(cost, fraction);
    return false;  // has no effect
  }
  std::vector<std::pair<double, double>> judged;

 private:
  double first_;
  int num_asked_ = 0;
};

// L = 1/2 (x - 10)^2 from 0. The cost of a rejected proposal is the
// candidate's; and the scale, which the rule remembers itself, is not: after
// two rejections -4 is proposed whole.
TEST(UpdateCallback, ARuleThatJudgesIsToldWhatBecameOfItsSteps) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  JudgingRule rule(60.0);
  Options options;
  options.by_merit = false;
  options.compare_with_plain = false;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(nullptr);
  solver_options.max_num_iterations = 4;
  callback.AddTo(&solver_options);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(rule.judged,
            (std::vector<std::pair<double, double>>{
                {1250.0, 1.0}, {200.0, 0.5}, {12.5, 0.25}, {0.5, 1.0}}));
  EXPECT_EQ(callback.summary().num_accepted, 2);
  EXPECT_EQ(callback.summary().num_withheld, 2);
}

// A manifold whose Plus fails now and then: there is no proposal, and no block
// keeps its part of it.
class Moody final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 1; }
  int TangentSize() const override { return 1; }
  bool Plus(const double* x, const double* d, double* y) const override {
    *y = *x + *d;
    return *y < 1000.0;
  }
  bool PlusJacobian(const double*, double* J) const override {
    *J = 1.0;
    return true;
  }
  bool Minus(const double* y, const double* x, double* d) const override {
    *d = *y - *x;
    return true;
  }
  bool MinusJacobian(const double*, double* J) const override {
    *J = 1.0;
    return true;
  }
};

TEST(UpdateCallback, FailingPlus) {
  // Ceres moves the blocks in the order in which they were added.
  for (const bool fails_first : {false, true}) {
    SCOPED_TRACE(fails_first);
    double x = -1.2;
    double y = 1.0;
    ceres::Problem problem;
    if (fails_first) problem.AddParameterBlock(&y, 1);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Rosenbrock, 2, 1, 1>(new Rosenbrock),
        nullptr,
        &x,
        &y);
    problem.SetManifold(&y, new Moody);
    int num_asked = 0;
    FunctionRule rule([&](const auto&, auto* step, std::string*) {
      *step = Eigen::Vector2d(1e4, 1e4);
      return ++num_asked == 1;
    });
    Options options;
    options.min_relative_model_decrease = -1e300;
    UpdateCallback callback(&rule, &problem, options);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &problem, &summary);
    EXPECT_EQ(callback.summary().num_withheld, 3);
    EXPECT_NEAR(x, 1.0, 1e-6);
    EXPECT_NEAR(y, 1.0, 1e-6);
  }
}

struct FourthPower {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] * x[0] * x[0];
    return true;
  }
};

// Dogleg's radius, which starts at 1e4, need never be as large again.
TEST(UpdateCallback, ABadProposalDoesNotSilenceTheRule) {
  for (const auto strategy : {ceres::LEVENBERG_MARQUARDT, ceres::DOGLEG}) {
    SCOPED_TRACE(strategy);
    double x = 1.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<FourthPower, 1, 1>(new FourthPower),
        nullptr,
        &x);
    int num_asked = 0;
    FunctionRule rule([&](const auto& at_x, auto* step, std::string*) {
      Eigen::MatrixXd J;
      at_x.jacobian->ToDense(&J);
      *step = (num_asked++ == 0 ? 100.0 : -1.0) * at_x.loss_gradient / J(0, 0);
      return true;
    });
    Options options;
    options.by_merit = false;
    options.min_relative_model_decrease = -1e300;
    options.compare_with_plain = false;
    UpdateCallback callback(&rule, &problem, options);
    ceres::Solver::Options solver_options = SolverOptions(nullptr);
    solver_options.trust_region_strategy_type = strategy;
    solver_options.max_num_iterations = 30;
    callback.AddTo(&solver_options);
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem, &summary);
    EXPECT_EQ(callback.summary().num_withheld, 3);
    EXPECT_GT(callback.summary().num_accepted, 5);
  }
}

// Cannot be evaluated below 99.99 the first 13 times: at 12 candidates, and once
// more to explain the first of them.
class Closed final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    r[0] = x[0][0] - 10.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1.0;
    return x[0][0] > 99.99 || ++num_failures_ > 13;
  }

 private:
  mutable int num_failures_ = 0;
};

// Four turns are rejected, until 2^-12 of the exact step is left, which
// promises 2^-11 of the cost: less than the 1e-3 that are asked for.
TEST(UpdateCallback, TheScaleRecoversFromSmallPromises) {
  double x = 100.0;
  ceres::Problem problem;
  problem.AddResidualBlock(new Closed, nullptr, &x);
  FunctionRule rule([](const auto& at_x, auto* step, std::string*) {
    *step = -at_x.gradient;
    return true;
  });
  Options options;
  options.by_merit = false;
  options.compare_with_plain = false;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(nullptr);
  // Ceres' own steps are short enough for 50 of them to stay above 99.99.
  solver_options.initial_trust_region_radius = 1e-6;
  solver_options.max_trust_region_radius = 1e-6;
  solver_options.function_tolerance = 0.0;
  solver_options.parameter_tolerance = 0.0;
  solver_options.max_num_iterations = 100;
  callback.AddTo(&solver_options);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(callback.summary().num_withheld, 12);
  EXPECT_GT(callback.summary().num_accepted, 3);
  EXPECT_NEAR(x, 10.0, 1e-9);
}

}  // namespace update_callback_rejections_test
}  // namespace invgrad
