#include "report/profiles.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"
#include "report/html_profiles.h"

namespace invgrad {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

// The value of a step function.
double ShareAt(const Series& series, double x) {
  double share = 0.0;
  for (size_t i = 0; i < series.x.size() && series.x[i] <= x; ++i) {
    share = series.y[i];
  }
  return share;
}

TEST(Profiles, WorkUntilTheCostHasFallenAllButTheTolerance) {
  // The least cost is 0, so that the goal is 10 % of 100.
  const std::vector<std::vector<SolveTrace>> traces = {
      {{{0, 1, 2, 3}, {100, 11, 10, 0}}, {{0, 5}, {100, 12}}}};
  const Eigen::MatrixXd work = WorkToSolve(traces, 0.1);
  ASSERT_EQ(work.rows(), 1);
  EXPECT_EQ(work(0, 0), 2.0);
  EXPECT_EQ(work(0, 1), kNever);
  EXPECT_EQ(WorkToSolve(traces, 0.12)(0, 1), 5.0);
  EXPECT_EQ(WorkToSolve(traces, 0.0)(0, 0), 3.0);
}

TEST(Profiles, DoNotDependOnTheUnitsOfCosts) {
  const auto traces = [](double unit, double shift) {
    return std::vector<std::vector<SolveTrace>>{
        {{{0, 1, 2}, {unit * 8 + shift, unit * 4 + shift, unit + shift}},
         {{0, 7}, {unit * 8 + shift, unit + shift}}}};
  };
  EXPECT_EQ(WorkToSolve(traces(1.0, 0.0), 0.5),
            WorkToSolve(traces(1024.0, 64.0), 0.5));
}

TEST(Profiles, ProblemsThatNoSolverImprovedAndRunsWithoutCostsDoNotCount) {
  EXPECT_EQ(WorkToSolve({{{{0, 1}, {2, 2}}, {{0, 1}, {2, 3}}}}, 0.1).rows(), 0);
  EXPECT_EQ(WorkToSolve({{{}, {}}}, 0.1).rows(), 0);
  EXPECT_EQ(WorkToSolve({}, 0.1).rows(), 0);
  const Eigen::MatrixXd one =
      WorkToSolve({{{}, {{0, 1, 2}, {2, NAN, 1}}}}, 0.1);
  ASSERT_EQ(one.rows(), 1);
  EXPECT_EQ(one(0, 0), kNever);
  EXPECT_EQ(one(0, 1), 2.0);
}

TEST(Profiles, AreSharesOfProblems) {
  // Solver 0 is twice as fast on two of four problems, and solves three.
  Eigen::MatrixXd work(4, 2);
  work << 1, 2, 2, 4, 9, 3, kNever, 5;
  const std::vector<Series> performance = PerformanceProfile(work);
  ASSERT_EQ(performance.size(), 2u);
  EXPECT_EQ(performance[1].color, 1);
  EXPECT_EQ(ShareAt(performance[0], 1.0), 0.5);
  EXPECT_EQ(ShareAt(performance[0], 2.9), 0.5);
  EXPECT_EQ(ShareAt(performance[0], 3.0), 0.75);
  EXPECT_EQ(ShareAt(performance[1], 1.0), 0.5);
  EXPECT_EQ(ShareAt(performance[1], 2.0), 1.0);
  EXPECT_EQ(performance[0].x.back(), performance[1].x.back());
  const std::vector<Series> data = DataProfile(work);
  EXPECT_EQ(ShareAt(data[0], 1.0), 0.25);
  EXPECT_EQ(ShareAt(data[0], 8.9), 0.5);
  EXPECT_EQ(ShareAt(data[0], 9.0), 0.75);
  EXPECT_EQ(ShareAt(data[1], 1.9), 0.0);
  EXPECT_EQ(ShareAt(data[1], 5.0), 1.0);
}

TEST(Profiles, AChartNeedsTwoProblems) {
  const std::vector<SolveTrace> problem = {{{0, 1}, {2, 1}}, {{0, 3}, {2, 1}}};
  EXPECT_TRUE(ProfileChart("starts", {{"seconds", {problem}}}).views.empty());
  const HtmlReport::Chart chart =
      ProfileChart("starts", {{"seconds", {problem, problem}}});
  EXPECT_EQ(chart.views.size(),
            8u);  // two profiles for each of four tolerances
  EXPECT_EQ(chart.views[0].y_label, "share of 2 starts");
}

}  // namespace
}  // namespace invgrad
