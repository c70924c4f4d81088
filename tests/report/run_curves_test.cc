#include "report/run_curves.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace invgrad {
namespace {

Series Curve(const std::vector<double>& x, const std::vector<double>& y) {
  Series curve;
  curve.x = x;
  curve.y = y;
  return curve;
}

TEST(MedianCurve, OfOneRunIsTheRun) {
  const Series curve = MedianCurve({Curve({1, 2}, {3, NAN})});
  EXPECT_EQ(curve.x, (std::vector<double>{1, 2}));
  EXPECT_TRUE(curve.y_low.empty());
}

TEST(MedianCurve, IsBetweenTheRunsWithTheirRangeAsBand) {
  const Series curve = MedianCurve(
      {Curve({1, 2}, {5, 1}), Curve({1, 2}, {3, 2}), Curve({1, 2}, {4, 9})});
  EXPECT_EQ(curve.y, (std::vector<double>{4, 2}));
  EXPECT_EQ(curve.y_low, (std::vector<double>{3, 1}));
  EXPECT_EQ(curve.y_high, (std::vector<double>{5, 9}));
}

TEST(MedianCurve, OfTwoRunsIsTheLowerOne) {
  EXPECT_EQ(MedianCurve({Curve({1}, {2}), Curve({1}, {1})}).y[0], 1.0);
}

TEST(MedianCurve, InterpolatesTheLogarithmAndKeepsTheLastValue) {
  const Series curve =
      MedianCurve({Curve({0, 2}, {100, 1}), Curve({0, 1, 3}, {900, 400, 200})});
  EXPECT_EQ(curve.x, (std::vector<double>{0, 1, 2, 3}));
  EXPECT_NEAR(curve.y_low[1], 10.0, 1e-12);
  EXPECT_NEAR(curve.y_high[2], 400.0 / std::sqrt(2.0), 1e-10);
  EXPECT_EQ(curve.y_low[3], 1.0);
}

TEST(MedianCurve, BeginsWhereAllRunsHaveBegun) {
  const Series curve =
      MedianCurve({Curve({0, 2}, {1, 1}), Curve({1, 2}, {1, 1})});
  EXPECT_EQ(curve.x, (std::vector<double>{1, 2}));
}

TEST(MedianCurve, AFailureCountsAsWorstAndLeavesTheBand) {
  const std::vector<Series> runs = {
      Curve({1, 2}, {1, NAN}), Curve({1, 2}, {2, 20}), Curve({1, 2}, {3, 30})};
  const Series curve = MedianCurve(runs);
  EXPECT_EQ(curve.y, (std::vector<double>{2, 30}));
  EXPECT_EQ(curve.y_high[1], 30.0);
  EXPECT_TRUE(std::isinf(MedianCurve({runs[0], runs[0], runs[1]}).y[1]));
}

}  // namespace
}  // namespace invgrad
