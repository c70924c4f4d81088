// The problems of More, Garbow and Hillstrom, and proposals on all of them.

#include "problems/estimation/more_garbow_hillstrom.h"

#include <memory>
#include <string>
#include <vector>

#include "ceres/gradient_checker.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/rules/rules.h"

namespace invgrad {
namespace more_garbow_hillstrom_test {

// With the rule's proposals, or alone without a rule.
double Solve(const MoreGarbowHillstromRow& row,
             double factor,
             UpdateRule* rule) {
  std::vector<double> x = row.start;
  for (double& value : x) value *= factor;
  ceres::Problem problem;
  problem.AddResidualBlock(row.make_cost(), nullptr, x.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 1000;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  if (rule == nullptr) {
    ceres::Solve(options, &problem, &summary);
  } else {
    UpdateCallback callback(rule, &problem);
    callback.AddTo(&options);
    ceres::Solve(options, &problem, &summary);
    EXPECT_FALSE(callback.summary().ended_on_proposal) << row.name;
  }
  EXPECT_TRUE(summary.IsSolutionUsable()) << row.name << summary.message;
  return 2.0 * summary.final_cost;
}

TEST(MoreGarbowHillstrom, DerivativesAreExact) {
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    const std::unique_ptr<ceres::CostFunction> cost(row.make_cost());
    ceres::NumericDiffOptions options;
    const ceres::GradientChecker checker(
        cost.get(),
        static_cast<const std::vector<const ceres::Manifold*>*>(nullptr),
        options);
    // Off the start, where some residuals have kinks or vanish.
    std::vector<double> x = row.start;
    for (double& value : x) value = 1.01 * value + 0.003;
    const double* blocks[] = {x.data()};
    ceres::GradientChecker::ProbeResults results;
    EXPECT_TRUE(checker.Probe(blocks, 1e-5, &results))
        << row.name << results.error_log;
  }
}

// [1], section 3: the minimum from the usual start; of three problems
// Levenberg-Marquardt finds another one ([1] names those of two), or stops in a
// flat region.
TEST(MoreGarbowHillstrom, MinimaAreThePublishedOnes) {
  int num_solved = 0;
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    const double minimum = Solve(row, 1.0, nullptr);
    EXPECT_GT(minimum, row.minimum * (1.0 - 1e-5)) << row.name;
    num_solved += IsSolution(row, minimum);
  }
  EXPECT_GE(num_solved, 15);
}

TEST(MoreGarbowHillstrom, NoRuleLosesAProblem) {
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    for (const double factor : {1.0, 10.0, 100.0}) {
      const double plain = Solve(row, factor, nullptr);
      for (const RuleRow& rule : Rules()) {
        std::string error;
        const double cost =
            Solve(row, factor, MakeRule(rule.name, &error).get());
        // Up to Ceres' function tolerance.
        EXPECT_TRUE(IsSolution(row, cost) || cost <= (1.0 + 1e-6) * plain)
            << rule.name << " on " << row.name << " from " << factor << ": "
            << cost << ", alone " << plain;
      }
    }
  }
}

}  // namespace more_garbow_hillstrom_test
}  // namespace invgrad
