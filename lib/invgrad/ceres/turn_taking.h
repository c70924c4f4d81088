// Decides whether the next step of a ceres::Solve is an update rule's or Ceres'
// own: that of the one whose steps gain more.
//
//   gain of a step = log(L before / L after),   0 if it was rejected
//   merit <- (merit + gain) / 2
//
// The rule has the first turn and Ceres the second. While the rule's merit is
// at least Ceres', the rule has the turns, except that Ceres has every ninth
// one, which keeps its merit up to date. Otherwise Ceres has the turns, and the
// rule has one again after 2 accepted steps, then 4, 8 and 16, as long as it
// does not gain more. A rule that had no step waits in the same way.
#ifndef INVGRAD_CERES_TURN_TAKING_H_
#define INVGRAD_CERES_TURN_TAKING_H_

#include <optional>

namespace invgrad {

class TurnTaking {
 public:
  // by_merit = false: the rule has all turns at which it has a step.
  explicit TurnTaking(bool by_merit) : by_merit_(by_merit) {}

  // Call it once after each accepted step: whether the next turn is the rule's.
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
