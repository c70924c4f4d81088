// The copy of a problem, and how often it asks the user's cost functions.
#include "invgrad/ceres/cached_problem.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/autodiff_second_order_cost_function.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/rules/rules.h"
#include "tests/ceres/prepared_problem.h"

namespace invgrad {
namespace cached_problem_test {

struct Counts {
  int with_jacobians = 0;
  int without = 0;
};

// r = (x_0^2 - y_0, 10 (y_1 - x_1^2)), x and y of size 2.
class CountingCost final : public ceres::SizedCostFunction<2, 2, 2> {
 public:
  explicit CountingCost(Counts* counts) : counts_(*counts) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    ++(jacobians == nullptr ? counts_.without : counts_.with_jacobians);
    const double* x = parameters[0];
    const double* y = parameters[1];
    residuals[0] = x[0] * x[0] - y[0];
    residuals[1] = 10.0 * (y[1] - x[1] * x[1]);
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      const double J[] = {2.0 * x[0], 0.0, 0.0, -20.0 * x[1]};
      std::copy_n(J, 4, jacobians[0]);
    }
    if (jacobians[1] != nullptr) {
      const double J[] = {-1.0, 0.0, 0.0, 10.0};
      std::copy_n(J, 4, jacobians[1]);
    }
    return true;
  }

 private:
  Counts& counts_;
};

struct Fixture {
  double x[2] = {1.5, -1.2};
  double y[2] = {1.0, 2.0};
  Counts counts;
  ceres::Problem problem;

  Fixture() {
    problem.AddResidualBlock(
        new CountingCost(&counts), new ceres::HuberLoss(0.5), x, y);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Anchor, 2, 2>(new Anchor), nullptr, x);
  }

  struct Anchor {
    template <typename T>
    bool operator()(const T* x, T* r) const {
      r[0] = 0.1 * (x[0] - 1.0);
      r[1] = 0.1 * (x[1] - 1.0);
      return true;
    }
  };
};

TEST(CachedProblem, SolvesAsTheProblemItself) {
  std::vector<double> costs[2];
  for (const bool is_cached : {false, true}) {
    Fixture f;
    CachedProblem cached({}, &f.problem);
    ceres::Solver::Summary summary;
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    ceres::Solve(options, is_cached ? cached.problem() : &f.problem, &summary);
    for (const auto& iteration : summary.iterations) {
      costs[is_cached ? 1 : 0].push_back(iteration.cost);
    }
  }
  // Bit for bit: every evaluation is the user's.
  EXPECT_EQ(costs[0], costs[1]);
  EXPECT_GT(costs[0].size(), 3u);
}

// What Ceres asks for is evaluated; what the callback asks for is not.
TEST(CachedProblem, LinearizesWithoutEvaluations) {
  Counts counts[3];
  int num_states[3];
  int num_withheld = 0;
  for (const int mode : {0, 1, 2}) {  // Ceres alone, callback, cached callback
    Fixture f;
    CachedProblem cached({}, &f.problem);
    ceres::Problem* const problem = mode == 2 ? cached.problem() : &f.problem;
    const auto rule = MakeRule("half_inverse:step_size=auto");
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.update_state_every_iteration = true;
    std::unique_ptr<UpdateCallback> callback;
    if (mode > 0) {
      UpdateCallback::Options callback_options;
      callback_options.compare_with_plain = false;
      callback = std::make_unique<UpdateCallback>(
          rule.get(), problem, callback_options);
      callback->AddTo(&options);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem, &summary);
    counts[mode] = f.counts;
    num_states[mode] = summary.num_successful_steps;  // the start is one
    if (mode > 0) {
      EXPECT_GT(callback->summary().num_accepted, 0);
      num_withheld = callback->summary().num_withheld;
    }
  }
  // Ceres: one a state. The callback: one more. From the cache: none, except at
  // candidates that are not proposed.
  EXPECT_EQ(counts[0].with_jacobians, num_states[0]);
  EXPECT_GT(counts[1].with_jacobians, num_states[1]);
  EXPECT_EQ(counts[2].with_jacobians, num_states[2] + num_withheld);
  EXPECT_EQ(num_states[1], num_states[2]) << "the same steps";
}

TEST(CachedProblem, KeepsManifoldsBoundsAndConstness) {
  Fixture f;
  f.problem.SetManifold(f.y, new ceres::SubsetManifold(2, {0}));
  f.problem.SetParameterBlockConstant(f.x);
  f.problem.SetParameterLowerBound(f.y, 1, -3.0);
  CachedProblem cached({}, &f.problem);
  const ceres::Problem& copy = *cached.problem();
  EXPECT_EQ(copy.NumResidualBlocks(), 2);
  EXPECT_EQ(copy.NumParameterBlocks(), 2);
  EXPECT_EQ(copy.GetManifold(f.y), f.problem.GetManifold(f.y));
  EXPECT_EQ(copy.GetManifold(f.x), nullptr);
  EXPECT_TRUE(copy.IsParameterBlockConstant(f.x));
  EXPECT_FALSE(copy.IsParameterBlockConstant(f.y));
  EXPECT_EQ(copy.GetParameterLowerBound(f.y, 1), -3.0);
  EXPECT_EQ(copy.GetParameterUpperBound(f.y, 1),
            f.problem.GetParameterUpperBound(f.y, 1));
  EXPECT_EQ(copy.GetParameterLowerBound(f.x, 0),
            f.problem.GetParameterLowerBound(f.x, 0));
  std::string error;
  EXPECT_FALSE(UpdateCallback::IsSupported({}, copy, &error));
  EXPECT_NE(error.find("bounds"), std::string::npos) << error;
}

// A block that becomes variable asks for a Jacobian that is not remembered.
TEST(CachedProblem, EvaluatesWhatItDoesNotRemember) {
  Fixture f;
  CachedProblem cached({}, &f.problem);
  LinearizationParts parts;
  parts.jacobian = true;
  std::string error;
  const auto linearize = [&] {
    Linearization at_x;
    ProblemLinearizer linearizer(cached.problem(), {});
    EXPECT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
    Linearization expected;
    ProblemLinearizer own(&f.problem, {});
    EXPECT_TRUE(own.Linearize(parts, &expected, &error)) << error;
    EXPECT_EQ(at_x.loss_gradient, expected.loss_gradient);
  };
  cached.problem()->SetParameterBlockConstant(f.x);
  f.problem.SetParameterBlockConstant(f.x);
  linearize();
  EXPECT_EQ(f.counts.with_jacobians, 2);
  linearize();
  EXPECT_EQ(f.counts.with_jacobians, 3) << "only the problem's own";
  cached.problem()->SetParameterBlockVariable(f.x);
  f.problem.SetParameterBlockVariable(f.x);
  linearize();
  EXPECT_EQ(f.counts.with_jacobians, 5);
  f.x[0] = -0.0;
  linearize();
  f.x[0] = 0.0;
  linearize();
  EXPECT_EQ(f.counts.with_jacobians, 9) << "+0 is not -0";
}

struct Quadratic {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] - 2.0;
    return true;
  }
};

TEST(CachedProblem, KeepsSecondDerivatives) {
  double x = 3.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new AutoDiffSecondOrderCostFunction<Quadratic, 1, 1>(new Quadratic),
      nullptr,
      &x);
  CachedProblem cached({}, &problem);
  LinearizationParts parts;
  parts.hessian = true;
  Linearization at_x;
  std::string error;
  ProblemLinearizer linearizer(cached.problem(), {});
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
  // (2 x)^2 + 2 r
  EXPECT_DOUBLE_EQ(at_x.hessian(0, 0), 36.0 + 14.0);
}

TEST(CachedProblem, CallsTheEvaluationCallback) {
  PreparedProblem p(3.0);
  CachedProblem::Options cached_options;
  cached_options.evaluation_callback = &p;
  CachedProblem cached(cached_options, &p.problem);
  const auto rule = MakeRule("gauss_newton");
  UpdateCallback callback(rule.get(), cached.problem());  // without it
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, cached.problem(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
  EXPECT_NEAR(p.x, std::sqrt(2.0), 1e-6);
  EXPECT_GT(callback.summary().num_accepted, 0);
}

}  // namespace cached_problem_test
}  // namespace invgrad
