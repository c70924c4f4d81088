#include "invgrad/ceres/turn_taking.h"

#include <string>

#include "gtest/gtest.h"

namespace invgrad {
namespace turn_taking_test {

// 'r' and 'c' for the turns of the rule and of Ceres, if every step of the one
// gains `rule` and of the other `ceres`.
std::string Turns(TurnTaking* turns, int num_turns, double rule, double ceres) {
  std::string order;
  for (int i = 0; i < num_turns; ++i) {
    if (turns->IsTheRules()) {
      order += 'r';
      turns->RuleStepped(rule);
    } else {
      order += 'c';
      turns->CeresStepped(ceres);
    }
  }
  return order;
}

TEST(TurnTaking, TheBetterOneGoesOn) {
  TurnTaking better(true);
  EXPECT_EQ(Turns(&better, 20, 2.0, 1.0), "rcrrrrrrrrcrrrrrrrrc");
  TurnTaking worse(true);
  EXPECT_EQ(Turns(&worse, 42, 1.0, 2.0),
            "rcrccrccccrccccccccrccccccccccccccccrccccc");
}

// As good as Ceres is good enough: at equal gains the rule goes on.
TEST(TurnTaking, EqualGains) {
  TurnTaking turns(true);
  EXPECT_EQ(Turns(&turns, 5, 0.0, 0.0), "rcrrr");
}

// The waits begin anew with a turn that was better.
TEST(TurnTaking, ARuleThatBecomesBetter) {
  TurnTaking turns(true);
  EXPECT_EQ(Turns(&turns, 10, 1.0, 2.0), "rcrccrcccc");
  EXPECT_EQ(Turns(&turns, 3, 5.0, 2.0), "rrr");
  EXPECT_EQ(Turns(&turns, 6, -9.0, 2.0), "rccrcc");
}

TEST(TurnTaking, TheRuleWaitsUntilItsNextTurn) {
  TurnTaking turns(true);
  EXPECT_TRUE(turns.IsTheRules());
  EXPECT_FALSE(turns.IsRuleWaiting());
  turns.RuleStepped(1.0);
  EXPECT_FALSE(turns.IsTheRules());  // Ceres' first turn
  EXPECT_FALSE(turns.IsRuleWaiting());
  turns.CeresStepped(0.5);
  EXPECT_TRUE(turns.IsTheRules());
  turns.RuleHadNoStep();
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(turns.IsRuleWaiting());
    EXPECT_FALSE(turns.IsTheRules());
    EXPECT_TRUE(turns.IsRuleWaiting());
  }
  EXPECT_TRUE(turns.IsTheRules());
  EXPECT_FALSE(turns.IsRuleWaiting());
}

TEST(TurnTaking, WithoutMeritTheRuleHasAllTurns) {
  TurnTaking turns(false);
  EXPECT_EQ(Turns(&turns, 12, -1.0, 2.0), "rrrrrrrrrrrr");
}

TEST(TurnTaking, ARuleWithoutAStepWaitsLongerAndLonger) {
  for (const bool by_merit : {false, true}) {
    TurnTaking turns(by_merit);
    std::string order;
    for (int i = 0; i < 55; ++i) {
      if (turns.IsTheRules()) {
        order += 'r';
        turns.RuleHadNoStep();
      } else {
        order += 'c';
        turns.CeresStepped(1.0);
      }
    }
    EXPECT_EQ(order, "rccrccccrccccccccrccccccccccccccccrccccccccccccccccrccc");
  }
}

}  // namespace turn_taking_test
}  // namespace invgrad
