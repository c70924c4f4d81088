// Decides whether the update rule or Ceres makes the next step of a
// ceres::Solve: the one whose steps gain more.
//
//   gain of a step = log(L before / L after),   0 if it was rejected
//   merit <- (merit + gain) / 2
//
// The rule has the first turn and Ceres the second. While the rule's merit is
// at least Ceres', the rule has all turns but every ninth, which updates the
// merit of Ceres. Otherwise Ceres has the turns, and the rule has one turn
// after 2 accepted steps, then after 4, 8 and 16, until its merit is higher.
// The same intervals apply after a turn in which the rule had no step.
#ifndef INVGRAD_CERES_TURN_TAKING_H_
#define INVGRAD_CERES_TURN_TAKING_H_

#include <optional>

namespace invgrad {

class TurnTaking {
 public:
  // by_merit = false: the rule has every turn for which it has a step.
  explicit TurnTaking(bool by_merit) : by_merit_(by_merit) {}

  // Returns whether the next turn is the rule's. Call once after each accepted
  // step.
  bool IsTheRules();

  void RuleStepped(double gain);
  void CeresStepped(double gain);
  void RuleHadNoStep();

 private:
  void Wait();

  static constexpr int kFirstWait = 2;
  static constexpr int kMaxWait = 16;
  static constexpr int kMaxInARow = 8;

  bool by_merit_;
  std::optional<double> rule_merit_;  // none before its first step
  std::optional<double> ceres_merit_;
  int num_in_a_row_ = 0;    // of the rule's turns
  int num_turns_left_ = 0;  // of Ceres, before the rule's next
  int next_wait_ = kFirstWait;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_TURN_TAKING_H_
