#include "report/answer.h"

#include <cmath>

#include "gtest/gtest.h"

namespace invgrad {
namespace {

TEST(Answer, NamesTheLowestTheNextAndTheBestFirstOrderMethod) {
  EXPECT_EQ(
      AnswerByScores("test loss",
                     {{"adam", 2e-3, 1e-3, 3e-3, 5, true},
                      {"gauss_newton", 1e-6, 9e-7, 2e-6, 5},
                      {"adaptive", 4e-6, 3e-6, 5e-6, 5},
                      {"gradient_descent", 1.0, 1.0, 1.0, 5, true}}),
      "gauss_newton has the lowest median test loss, 1e-06: 4 times lower "
      "than adaptive, the next (4e-06), and 2e+03 times lower than adam, "
      "the best first-order method (0.002). Over 5 seeds their ranges do "
      "not overlap: 9e-07 to 2e-06 and 3e-06 to 5e-06.");
}

TEST(Answer, SaysWhetherRangesOverlapAndWhetherThereIsOneSeed) {
  const Score adam = {"adam", 3.0, 1.5, 4.0, 3, true};
  EXPECT_EQ(AnswerByScores("L", {adam, {"newton", 1.0, 0.5, 2.0, 3}}),
            "newton has the lowest median L, 1: 3 times lower than adam, the "
            "next (3) and the best first-order method. Over 3 seeds their "
            "ranges overlap: 0.5 to 2 and 1.5 to 4.");
  EXPECT_EQ(
      AnswerByScores(
          "L", {{"a", 1.0, 1.0, 1.0, 1, true}, {"b", 1.001, 1.001, 1.001, 1}}),
      "a has the lowest L, 1: as low as b, the next (1); it is a "
      "first-order method. One seed: another may change the order.");
}

TEST(Answer, NoFactorOfALossOfZeroAndNoSeedsOfAPoint) {
  EXPECT_EQ(AnswerByScores("L", {{"newton", 0.0}, {"adam", 1.0}}),
            "newton has the lowest L, 0: lower than adam, the next (1).");
  EXPECT_EQ(AnswerByScores("L", {{"newton", 0.0}, {"adam", 0.0}}),
            "newton has the lowest L, 0: as low as adam, the next (0).");
}

TEST(Answer, FailedMethodsAreNamed) {
  EXPECT_EQ(AnswerByScores("L", {{"a", NAN}, {"b", 1.0}, {"c", INFINITY}}),
            "b has the lowest L, 1. No result of a and c.");
  EXPECT_EQ(AnswerByScores("L", {{"a", NAN}}),
            "No method has a result. No result of a.");
  EXPECT_EQ(AnswerByScores("L", {}), "");
}

TEST(Answer, CountsWhoComesFirst) {
  EXPECT_EQ(AnswerByCounts("has the lowest L",
                           "at",
                           "points",
                           {{"a", 1}, {"b", 5}, {"c", 0}},
                           6),
            "b has the lowest L at 5 of 6 points, a at 1.");
  EXPECT_EQ(AnswerByCounts("has the lowest L", "at", "points", {{"a", 0}}, 6),
            "");
}

}  // namespace
}  // namespace invgrad
