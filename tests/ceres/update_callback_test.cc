#include "invgrad/update_callback.h"

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "tests/ceres/callback_problems.h"
#include "tests/ceres/prepared_problem.h"
#include "tests/support/function_rule.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace update_callback_test {

using Options = UpdateCallback::Options;

TEST(UpdateCallback, PowerRulesConvergeOnRosenbrock) {
  for (const double kappa : {0.0, 0.5, 1.0}) {
    SCOPED_TRACE(kappa);
    TwoBlockRosenbrock p;
    PowerRule rule(kappa);
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_NEAR(p.x, 1.0, 1e-6);
    EXPECT_NEAR(p.y, 1.0, 1e-6);

    const UpdateCallback::Summary counts = callback.summary();
    EXPECT_GT(counts.num_accepted, 0);
    // Every iteration but the start is a proposal, a step of Ceres, or the move
    // to the result of the plain solve.
    const int num_iterations = static_cast<int>(summary.iterations.size()) - 1;
    EXPECT_EQ(
        counts.num_proposed + counts.num_ceres_steps + counts.took_plain_result,
        num_iterations);
    EXPECT_EQ(counts.num_proposed, counts.num_accepted + counts.num_rejected);
    // The rule is asked at most once an accepted state.
    EXPECT_LE(rule.num_calls, summary.num_successful_steps);
    // The cost never rises.
    double cost = summary.initial_cost;
    for (const ceres::IterationSummary& iteration : summary.iterations) {
      if (!iteration.step_is_successful) continue;
      EXPECT_LE(iteration.cost, cost);
      cost = iteration.cost;
    }
  }
}

// The candidate is the rule's step and not Ceres', to the last bit.
TEST(UpdateCallback, TheCandidateIsTheRules) {
  TwoBlockRosenbrock p;
  const Eigen::Vector2d wanted(0.125, 0.25);
  FunctionRule rule([&](const auto&, auto* step, std::string*) {
    *step = wanted;
    return true;
  });
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options solver_options = SolverOptions(nullptr);
  solver_options.max_num_iterations = 1;
  callback.AddTo(&solver_options);
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &p.problem, &summary);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_proposed, 1);
  EXPECT_EQ(counts.num_accepted, 1);
  EXPECT_EQ(p.x, -1.2 + 0.125);
  EXPECT_EQ(p.y, 1.0 + 0.25);
}

TEST(UpdateCallback, RulesWithControlConvergeOnRosenbrock) {
  for (const char* name :
       {"half_inverse", "gauss_newton", "levenberg_marquardt"}) {
    SCOPED_TRACE(name);
    const auto rule =
        MakeRule(std::string(name) + ":control=gain:step_size=auto:rho=1");
    TwoBlockRosenbrock p;
    UpdateCallback callback(rule.get(), &p.problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_NEAR(p.x, 1.0, 1e-6);
    EXPECT_NEAR(p.y, 1.0, 1e-6);
    EXPECT_GT(callback.summary().num_accepted, 0);
  }
}

// Rejections shrink Ceres' trust region. A rule that is always wrong must not
// shrink it until Ceres takes its own short steps for convergence.
TEST(UpdateCallback, AWrongRuleDoesNotStopCeres) {
  TwoBlockRosenbrock p;
  // Uphill, as far as ever, although the callback learns to take less of it.
  double length = 1.0;
  FunctionRule rule([&](const auto& at_x, auto* step, std::string*) {
    *step = length * at_x.gradient.normalized();
    length *= 8.0;
    return true;
  });
  Options options;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &p.problem, options);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
  EXPECT_NEAR(p.y, 1.0, 1e-6);
  EXPECT_GE(callback.summary().num_withheld, 3);
}

TEST(UpdateCallback, SmallPromisesAreLeftToCeres) {
  TwoBlockRosenbrock p;
  // Along the gradient, for a relative decrease of 1e-6 by the linear model.
  FunctionRule rule([](const auto& at_x, auto* step, std::string*) {
    *step = -1e-6 * at_x.cost / at_x.gradient.squaredNorm() * at_x.gradient;
    return true;
  });
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  EXPECT_NE(callback.summary().message.find("too small"), std::string::npos);
}

TEST(UpdateCallback, ManifoldsLossesAndConstantBlocks) {
  for (const double kappa : {0.5, 1.0}) {
    for (const int num_threads : {1, 2}) {
      PoseProblem p;
      PowerRule rule(kappa);
      UpdateCallback callback(&rule, &p.problem);
      ceres::Solver::Options options = SolverOptions(nullptr);
      options.num_threads = num_threads;
      // The fixed cost of the anchors would hide the end.
      options.function_tolerance = 1e-16;
      callback.AddTo(&options);
      ceres::Solver::Summary summary;
      ceres::Solve(options, &p.problem, &summary);
      EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
          << summary.message;
      EXPECT_GT(summary.fixed_cost, 1.0);
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(p.q[i], p.kTruth[i], 1e-6);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(p.t[i], p.kShift[i], 1e-6);
      EXPECT_GT(callback.summary().num_accepted, 0);
      EXPECT_EQ(p.points[0][0], 1.0);
    }
  }
}

TEST(UpdateCallback, OtherTrustRegions) {
  const std::vector<std::function<void(ceres::Solver::Options*)>> variants = {
      [](auto* o) { o->trust_region_strategy_type = ceres::DOGLEG; },
      [](auto* o) { o->use_inner_iterations = true; },
      [](auto* o) { o->use_nonmonotonic_steps = true; },
      [](auto* o) { o->linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY; },
  };
  for (std::size_t i = 0; i < variants.size(); ++i) {
    SCOPED_TRACE(i);
    TwoBlockRosenbrock p;
    PowerRule rule(0.5);
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Options options = SolverOptions(nullptr);
    variants[i](&options);
    callback.AddTo(&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
        << summary.message << callback.summary().message;
    EXPECT_NEAR(p.x, 1.0, 1e-5);
    EXPECT_NEAR(p.y, 1.0, 1e-5);
  }
}

// A rule that never has a step changes nothing, to the last bit. The last step
// of Ceres, which Ceres alone would discard, is kept.
TEST(UpdateCallback, WithoutProposalsItIsPlainCeres) {
  PoseProblem plain;
  ceres::Solver::Summary plain_summary;
  ceres::Solve(SolverOptions(nullptr), &plain.problem, &plain_summary);

  PoseProblem p;
  FunctionRule rule([](const auto&, auto*, std::string* error) {
    *error = "no step today";
    return false;
  });
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  ASSERT_EQ(summary.iterations.size(), plain_summary.iterations.size() + 1);
  for (std::size_t i = 0; i < plain_summary.iterations.size(); ++i) {
    EXPECT_EQ(summary.iterations[i].cost, plain_summary.iterations[i].cost);
  }
  EXPECT_LE(summary.final_cost, plain_summary.final_cost);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_proposed, 0);
  EXPECT_EQ(counts.num_ceres_steps,
            static_cast<int>(summary.iterations.size()) - 1);
  EXPECT_EQ(counts.message, "no step today");
}

// r = exp(x) - 2, which counts its evaluations.
class CountingExp final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit CountingExp(int* num_evaluations)
      : num_evaluations_(*num_evaluations) {}
  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    ++num_evaluations_;
    r[0] = std::exp(x[0][0]) - 2.0;
    if (jacobians != nullptr) jacobians[0][0] = std::exp(x[0][0]);
    return true;
  }

 private:
  int& num_evaluations_;
};

// Needs nothing, and has no step.
class ContentRule final : public UpdateRule {
 public:
  LinearizationParts Needs() const override { return {}; }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd*,
                   std::string* error) override {
    EXPECT_EQ(at_x.jacobian, nullptr);
    costs.push_back(at_x.cost);
    *error = "content";
    return false;
  }
  std::vector<double> costs;
};

TEST(UpdateCallback, ARuleThatNeedsNothingIsAskedFirst) {
  int num_evaluations[2] = {0, 0};
  for (const bool has_callback : {false, true}) {
    double x = 5.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new CountingExp(&num_evaluations[has_callback]), nullptr, &x);
    ContentRule rule;
    UpdateCallback callback(&rule, &problem);
    ceres::Solver::Summary summary;
    ceres::Solve(
        SolverOptions(has_callback ? &callback : nullptr), &problem, &summary);
    EXPECT_NEAR(x, std::log(2.0), 1e-6);
    if (!has_callback) continue;
    // At the first state and at the fourth.
    ASSERT_GE(rule.costs.size(), 2u);
    EXPECT_EQ(rule.costs[0], summary.iterations[0].cost);
    EXPECT_EQ(rule.costs[1], summary.iterations[3].cost);
  }
  // One more, of the step of length zero that ends the run.
  EXPECT_EQ(num_evaluations[0] + 1, num_evaluations[1]);
}

TEST(UpdateCallback, EvaluationCallback) {
  PreparedProblem p(20.0);
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
      << callback.summary().message;
  EXPECT_NEAR(p.x, std::sqrt(2.0), 1e-6);
  EXPECT_GT(callback.summary().num_accepted, 0);
}

}  // namespace update_callback_test
}  // namespace invgrad
