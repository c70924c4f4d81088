#include "problems/estimation/named_values.h"

#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace named_values_test {

const std::vector<std::string> kNames = {"a", "k"};

TEST(NamedValues, ReadsThemInAnyOrder) {
  Eigen::Vector2d starts;
  std::string error;
  ASSERT_TRUE(
      ReadStartValues(" k = -2e-1, a=+3", kNames, "t", starts.data(), &error))
      << error;
  EXPECT_EQ(starts, Eigen::Vector2d(3.0, -0.2));
}

TEST(NamedValues, SaysWhichStartValueIsWrong) {
  const std::vector<std::pair<const char*, const char*>> cases = {
      {"", "no start value for a, k"},
      {"a=1", "no start value for k"},
      {"a=1,k=nan", "k=nan; expected a finite number"},
      {"a=1,k=", "k=; expected a finite number"},
      {"a=1,b=2", "no parameter 'b'; it has a, k"},
      {"a=1,a=2", "a is there twice"},
      {"a", "found 'a'; expected NAME=..."}};
  for (const auto& [text, part] : cases) {
    Eigen::Vector2d starts;
    std::string error;
    EXPECT_FALSE(ReadStartValues(text, kNames, "t, y", starts.data(), &error));
    EXPECT_NE(error.find(part), std::string::npos) << text << ": " << error;
  }
}

TEST(NamedValues, ReadsBounds) {
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  std::string error;
  ASSERT_TRUE(ReadBounds(
      "a=-1..2.5", kNames, Eigen::Vector2d::Zero(), &lower, &upper, &error))
      << error;
  EXPECT_EQ(lower, Eigen::Vector2d(-1.0, -kUnbounded));
  EXPECT_EQ(upper, Eigen::Vector2d(2.5, kUnbounded));
  ASSERT_TRUE(ReadBounds(
      "a=..3,k=0..", kNames, Eigen::Vector2d::Zero(), &lower, &upper, &error))
      << error;
  EXPECT_EQ(lower, Eigen::Vector2d(-kUnbounded, 0.0));
  EXPECT_EQ(upper, Eigen::Vector2d(3.0, kUnbounded));
}

TEST(NamedValues, SaysWhichBoundsAreWrong) {
  for (const char* text :
       {"a=1", "a=2..1", "a=1..1", "a=x..2", "a=1..2", "b=0..1", "a=0..nan"}) {
    Eigen::VectorXd lower;
    Eigen::VectorXd upper;
    std::string error;
    EXPECT_FALSE(ReadBounds(
        text, kNames, Eigen::Vector2d::Zero(), &lower, &upper, &error))
        << text;
    EXPECT_EQ(error.find("--bounds: "), 0) << text << ": " << error;
  }
}

}  // namespace named_values_test
}  // namespace invgrad
