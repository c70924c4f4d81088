// The limit on the time that proposals add to a solve.

#include "invgrad/ceres/work_limit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/function_rule.h"

namespace invgrad {
namespace work_limit_test {

struct Difference {
  template <typename T>
  bool operator()(const T* x, const T* y, T* residual) const {
    using std::sin;
    residual[0] = y[0] - x[0] - 0.1 * sin(x[0]) - 1.0;
    return true;
  }
};

// A chain of scalars: n parameters, n residuals, 2 n - 1 entries of J.
struct Chain {
  explicit Chain(int size) : x(size, 0.0) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset),
        nullptr,
        &x[0]);
    for (int i = 1; i < size; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Difference, 1, 1, 1>(new Difference),
          nullptr,
          &x[i - 1],
          &x[i]);
    }
  }
  std::vector<double> x;
  ceres::Problem problem;
};

// Of a chain of 100: an iteration of Ceres, the two linearizations of a proposal
// and a product with J, in operations.
constexpr double kIteration = 2e5 + 500.0 * 199.0;
constexpr double kLinearizations = 2.0 * 0.4 * kIteration;
constexpr double kProduct = 12.0 * 199.0 + 25.0 * 100.0;

LinearizationParts Products(int num_products) {
  LinearizationParts parts = LinearizationParts::Gradient();
  parts.num_products = num_products;
  return parts;
}

// Gradient descent whose step takes that many products.
FunctionRule RuleOfProducts(int num_products) {
  return FunctionRule(Products(num_products),
                      [](const auto& at_x, auto* step, std::string*) {
                        *step = -1e-3 * at_x.gradient;
                        return true;
                      });
}

// The iterations that a run can make, P = 100, if every one is a proposal.
int NumProposals(int num_products, double max_relative_work) {
  Chain chain(100);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  WorkLimit work(max_relative_work,
                 /*has_comparison=*/true,
                 Products(num_products),
                 /*iterations_of_function=*/0.0,
                 options,
                 ReadStructure(chain.problem, {}));
  work.SetComparison(100);
  int num_proposals = 0;
  while (num_proposals < 1000 && work.AllowsStep()) {
    work.CountStep();
    work.CountLinearization();
    work.CountLinearization();
    work.CountIteration();
    ++num_proposals;
  }
  return num_proposals;
}

// (iterations + 2) W + w <= (max_relative_work - 1) P W.
TEST(WorkLimit, IsTheFormula) {
  for (const int num_products : {0, 1, 12, 100, 200, 300}) {
    for (const double max_relative_work : {1.0, 1.05, 1.1, 2.0, 3.0}) {
      const double limit =
          ((max_relative_work - 1.0) * 100.0 - 2.0) * kIteration;
      // No iteration takes more than 100 of each kind.
      const double proposal =
          kIteration + std::min(num_products, 200) * kProduct + kLinearizations;
      EXPECT_EQ(NumProposals(num_products, max_relative_work),
                std::max(0.0, std::floor(limit / proposal)))
          << num_products << ", " << max_relative_work;
    }
  }
  EXPECT_EQ(NumProposals(12, std::numeric_limits<double>::infinity()), 1000);
}

// With dynamic sparsity the zeros of J cost Ceres next to nothing, and the rule
// as much as ever.
TEST(WorkLimit, DynamicSparsityLeavesLessForTheRule) {
  Chain chain(100);
  ceres::Solver::Options options;
  int num_steps[2];
  for (const bool is_dynamic : {false, true}) {
    options.dynamic_sparsity = is_dynamic;
    WorkLimit work(2.0,
                   /*has_comparison=*/true,
                   Products(200),
                   /*iterations_of_function=*/0.0,
                   options,
                   ReadStructure(chain.problem, {}));
    work.SetComparison(100);
    num_steps[is_dynamic] = 0;
    for (; work.AllowsStep(); ++num_steps[is_dynamic]) work.CountStep();
  }
  EXPECT_LT(num_steps[true], num_steps[false]);
}

// A rule whose steps cost more than all of Ceres' iterations changes nothing:
// a truncated step takes the singular values of 3,000 unknowns.
TEST(WorkLimit, ARuleThatTakesTooLongMakesNoProposals) {
  ceres::Solver::Options options = SolverOptions(nullptr);
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 50;
  Chain plain(3000);
  ceres::Solver::Summary plain_summary;
  ceres::Solve(options, &plain.problem, &plain_summary);

  Chain chain(3000);
  const auto rule = MakeRule("half_inverse:step_size=auto:rho=1");
  UpdateCallback callback(rule.get(), &chain.problem);
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &chain.problem, &summary);
  EXPECT_EQ(summary.iterations.size(), plain_summary.iterations.size());
  EXPECT_EQ(chain.x, plain.x);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  const std::string report = callback.summary().BriefReport();
  EXPECT_NE(report.find("max_relative_work = 2"), std::string::npos) << report;
}

// The iterations of Ceres, of the comparison and of the run, and the work of
// the rule, are at most twice those of Ceres alone.
TEST(WorkLimit, HoldsForTheSolve) {
  struct Offsets {
    Offsets() : x(100, 0.0) {
      for (double& value : x) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset),
            nullptr,
            &value);
      }
    }
    std::vector<double> x;
    ceres::Problem problem;
  };
  constexpr double kIterationOfOffsets = 2e5 + 500.0 * 100.0;
  constexpr double kProductOfOffsets = 12.0 * 100.0 + 25.0 * 100.0;
  for (const int num_products : {10, 50, 200}) {
    const double relative_step =
        num_products * kProductOfOffsets / kIterationOfOffsets;
    // A small trust region makes for many iterations.
    ceres::Solver::Options options = SolverOptions(nullptr);
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.initial_trust_region_radius = 0.1;
    options.max_trust_region_radius = 0.1;
    Offsets plain;
    ceres::Solver::Summary plain_summary;
    ceres::Solve(options, &plain.problem, &plain_summary);
    const double num_plain = plain_summary.iterations.size() - 1.0;
    ASSERT_GT(num_plain, 100.0);
    ASSERT_EQ(plain_summary.termination_type, ceres::CONVERGENCE);

    Offsets offsets;
    FunctionRule rule = RuleOfProducts(num_products);
    UpdateCallback::Options callback_options;
    callback_options.min_relative_model_decrease = 1e-12;
    UpdateCallback callback(&rule, &offsets.problem, callback_options);
    callback.AddTo(&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &offsets.problem, &summary);
    const UpdateCallback::Summary counts = callback.summary();
    EXPECT_EQ(counts.num_plain_iterations, num_plain);
    EXPECT_GT(counts.num_proposed + counts.num_withheld, 0);
    EXPECT_LE(num_plain + summary.iterations.size() - 1.0 +
                  relative_step * counts.num_proposed,
              2.0 * num_plain)
        << counts.BriefReport();
    EXPECT_LE(summary.final_cost, plain_summary.final_cost);
  }
}

}  // namespace work_limit_test
}  // namespace invgrad
