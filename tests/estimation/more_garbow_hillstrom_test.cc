// The problems of More, Garbow and Hillstrom, and proposals on all of them.

#include "problems/more_garbow_hillstrom.h"

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

namespace invgrad {
namespace more_garbow_hillstrom_test {

// The sum of squares, with the rule's proposals, or alone without a rule;
// infinite if the solver fails.
double Solve(const MoreGarbowHillstromRow& row,
             double factor,
             UpdateRule* rule) {
  std::vector<double> x = row.start;
  for (double& value : x) value *= factor;
  const std::unique_ptr<ceres::Problem> problem =
      MakeMoreGarbowHillstrom(row, &x);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 1000;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  if (rule == nullptr) {
    ceres::Solve(options, problem.get(), &summary);
  } else {
    UpdateCallback callback(rule, problem.get());
    callback.AddTo(&options);
    ceres::Solve(options, problem.get(), &summary);
    EXPECT_FALSE(callback.summary().ended_on_proposal)
        << row.name << " from " << factor << ": " << summary.message;
  }
  return summary.IsSolutionUsable() ? SumOfSquares(problem.get())
                                    : std::numeric_limits<double>::infinity();
}

// [1], section 3. From its usual start Levenberg-Marquardt finds another minimum
// of some problems, which [1] names as well, or stops in a flat region.
TEST(MoreGarbowHillstrom, MinimaAreThePublishedOnes) {
  int num_solved = 0;
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    const double minimum = Solve(row, 1.0, nullptr);
    EXPECT_GT(minimum, row.minimum * (1.0 - 1e-5)) << row.name;
    num_solved += IsSolution(row, minimum);
  }
  EXPECT_GE(num_solved, 14);
}

// [2]: no end lies below the minimum within the bounds. Three reach it with
// Ceres' default tolerances (five with tolerances of 1e-18).
TEST(MoreGarbowHillstrom, BoundedMinimaAreThePublishedOnes) {
  int num_solved = 0;
  for (const MoreGarbowHillstromRow& row : BoundedMoreGarbowHillstrom()) {
    const double minimum = Solve(row, 1.0, nullptr);
    EXPECT_GT(minimum, row.minimum * (1.0 - 1e-5)) << row.name;
    num_solved += IsSolution(row, minimum);
  }
  EXPECT_GE(num_solved, 3);
}

void ExpectNoRuleLosesAProblem(
    const std::vector<MoreGarbowHillstromRow>& rows) {
  for (const MoreGarbowHillstromRow& row : rows) {
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

TEST(MoreGarbowHillstrom, NoRuleLosesAProblem) {
  ExpectNoRuleLosesAProblem(MoreGarbowHillstrom());
}

TEST(MoreGarbowHillstrom, NoRuleLosesABoundedProblem) {
  ExpectNoRuleLosesAProblem(BoundedMoreGarbowHillstrom());
}

}  // namespace more_garbow_hillstrom_test
}  // namespace invgrad
