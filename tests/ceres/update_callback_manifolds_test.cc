// The manifolds that UpdateCallback wraps, and that it leaves as they were.

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/iteration_callback.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/rosenbrock.h"
#if __has_include("ceres/local_parameterization.h")
#include "ceres/local_parameterization.h"
#endif

namespace invgrad {
namespace update_callback_manifolds_test {

// The blocks that have none of their own.
TEST(UpdateCallback, ManifoldsAreThereForItsOwnStepsOnly) {
  class Watch final : public ceres::IterationCallback {
   public:
    explicit Watch(const PoseProblem* p) : p_(*p) {}
    ceres::CallbackReturnType operator()(
        const ceres::IterationSummary&) override {
      EXPECT_TRUE(p_.problem.HasManifold(p_.q));
      has_manifold.push_back(p_.problem.HasManifold(p_.t));
      return ceres::SOLVER_CONTINUE;
    }
    std::vector<bool> has_manifold;  // p.t after each iteration

   private:
    const PoseProblem& p_;
  };
  PoseProblem p;
  PowerRule power(0.5);
  // At every other question.
  int num_questions = 0;
  class Sometimes final : public UpdateRule {
   public:
    Sometimes(PowerRule* rule, int* num_questions)
        : rule_(*rule), num_questions_(*num_questions) {}
    LinearizationParts Needs() const override { return rule_.Needs(); }
    bool ComputeStep(const Linearization& at_x,
                     Eigen::VectorXd* step,
                     std::string* error) override {
      *error = "not now";
      return num_questions_++ % 2 == 0 && rule_.ComputeStep(at_x, step, error);
    }

   private:
    PowerRule& rule_;
    int& num_questions_;
  };
  Sometimes rule(&power, &num_questions);
  UpdateCallback::Options callback_options;
  callback_options.compare_with_plain = false;
  UpdateCallback callback(&rule, &p.problem, callback_options);
  Watch watch(&p);
  ceres::Solver::Options options = SolverOptions(&callback);
  options.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  const auto num_staged =
      std::count(watch.has_manifold.begin(), watch.has_manifold.end(), true);
  // The last one is the step of length zero that ends the run.
  EXPECT_EQ(num_staged,
            callback.summary().num_proposed +
                callback.summary().took_plain_result + 1);
  EXPECT_GT(num_staged, 0);
  EXPECT_GT(callback.summary().num_ceres_steps, 0);
  EXPECT_LT(power.num_calls, num_questions);
}

TEST(UpdateCallback, RestoresManifolds) {
  for (const ceres::Ownership ownership :
       {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
    ceres::QuaternionManifold owned_here;
    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ownership;
    ceres::Manifold* manifold = ownership == ceres::TAKE_OWNERSHIP
                                    ? new ceres::QuaternionManifold
                                    : &owned_here;
    PoseProblem p(problem_options, manifold);
    // Twice: a second callback after the first.
    for (int i = 0; i < 2; ++i) {
      PowerRule rule(0.5);
      UpdateCallback::Options options;
      options.manifold_ownership = ownership;
      UpdateCallback callback(&rule, &p.problem, options);
      EXPECT_NE(p.problem.GetManifold(p.q), manifold);
      EXPECT_TRUE(p.problem.HasManifold(p.t));
      ceres::Solver::Summary summary;
      ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    }
    EXPECT_EQ(p.problem.GetManifold(p.q), manifold);
    EXPECT_FALSE(p.problem.HasManifold(p.t));
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(nullptr), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  }
}

// Problems that own their manifolds and problems that do not, some of them moved
// or at the address of an earlier one. Freed memory that is used or freed again
// is found by the sanitizers.
TEST(UpdateCallback, ManifoldsAreDeletedOnce) {
  const auto solve =
      [](ceres::Ownership ownership, double* x, ceres::Problem* problem) {
        *x = 0.0;
        PowerRule rule(0.5);
        UpdateCallback::Options options;
        options.compare_with_plain = false;
        options.manifold_ownership = ownership;
        UpdateCallback callback(&rule, problem, options);
        ceres::Solver::Summary summary;
        ceres::Solve(SolverOptions(&callback), problem, &summary);
        EXPECT_NEAR(*x, 10.0, 1e-6);
        EXPECT_GT(callback.summary().num_accepted, 0);
      };
  for (int round = 0; round < 3; ++round) {
    for (const ceres::Ownership ownership :
         {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
      ceres::Problem::Options options;
      options.manifold_ownership = ownership;
      const auto new_problem = [&options](double* x) {
        auto problem = std::make_unique<ceres::Problem>(options);
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset),
            nullptr,
            x);
        return problem;
      };
      double x = 0.0;
      double y = 0.0;
      std::unique_ptr<ceres::Problem> first = new_problem(&x);
      solve(ownership, &x, first.get());
      // The second object has the first one's manifolds, and the first object
      // becomes another problem.
      ceres::Problem second(std::move(*first));
      *first = std::move(*new_problem(&y));
      solve(ownership, &y, first.get());
      solve(ownership, &x, &second);
      solve(ownership, &y, first.get());
    }
  }
}

// A callback with the same options has the same effect in a second solve.
TEST(UpdateCallback, TakesPartInSeveralSolves) {
  for (const bool same_options : {true, false}) {
    PoseProblem p;
    const double start[4] = {p.q[0], p.q[1], p.q[2], p.q[3]};
    PowerRule rule(0.5);
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Options options = SolverOptions(&callback);
    std::string first_report;
    std::vector<double> first_costs;
    for (int i = 0; i < 3; ++i) {
      if (i > 0) {
        if (!same_options) options = SolverOptions(nullptr);
        callback.AddTo(&options);
      }
      EXPECT_EQ(options.callbacks.size(), 1u);
      std::copy_n(start, 4, p.q);
      std::fill_n(p.t, 3, 0.0);
      ceres::Solver::Summary summary;
      ceres::Solve(options, &p.problem, &summary);
      EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
      EXPECT_GT(callback.summary().num_accepted, 0);
      std::vector<double> costs;
      for (const auto& iteration : summary.iterations) {
        costs.push_back(iteration.cost);
      }
      if (i == 0) {
        first_report = callback.summary().BriefReport();
        first_costs = costs;
      }
      EXPECT_EQ(callback.summary().BriefReport(), first_report);
      EXPECT_EQ(costs, first_costs);
    }
  }
}

// Ceres 2.1 has local parameterizations, which it wraps in manifolds.
#if __has_include("ceres/local_parameterization.h")
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(UpdateCallback, KeepsLocalParameterizations) {
  for (const ceres::Ownership ownership :
       {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
    ceres::QuaternionParameterization owned_here;
    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ownership;
    problem_options.local_parameterization_ownership = ownership;
    PoseProblem p(problem_options, nullptr);
    p.problem.SetParameterization(p.q,
                                  ownership == ceres::TAKE_OWNERSHIP
                                      ? new ceres::QuaternionParameterization
                                      : &owned_here);
    {
      PowerRule rule(0.5);
      UpdateCallback::Options options;
      options.manifold_ownership = ownership;
      UpdateCallback callback(&rule, &p.problem, options);
      ceres::Solver::Options solver_options = SolverOptions(nullptr);
      solver_options.function_tolerance = 1e-16;
      callback.AddTo(&solver_options);
      ceres::Solver::Summary summary;
      ceres::Solve(solver_options, &p.problem, &summary);
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(p.q[i], p.kTruth[i], 1e-6);
      EXPECT_GT(callback.summary().num_accepted, 0);
    }
    EXPECT_FALSE(p.problem.HasManifold(p.t));
    EXPECT_EQ(p.problem.ParameterBlockTangentSize(p.q), 3);
    p.q[0] += 0.1;
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(nullptr), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  }
}
#pragma GCC diagnostic pop
#endif

}  // namespace update_callback_manifolds_test
}  // namespace invgrad
