// Whose turn the next step is, where an update rule and Ceres' trust region
// take turns at the same problem: that of the one whose steps gain more.
//
//   gain of a step = log(L before / L after),   0 if it was rejected
//   merit <- (merit + gain) / 2
//
// The rule has the first turn and Ceres the second. While the rule's merit is
// at least Ceres', the rule goes on, and Ceres has every ninth turn, so that
// its merit is that of the region where the two are now. Otherwise Ceres goes
// on, and the rule has a turn again after 2 accepted steps, then 4, 8 and 16,
// as long as it does not gain more; likewise after it had no step.
#ifndef INVGRAD_CERES_TURN_TAKING_H_
#define INVGRAD_CERES_TURN_TAKING_H_

#include <limits>

namespace invgrad {

class TurnTaking {
 public:
  // by_merit: false leaves the rule all turns at which it has a step.
  explicit TurnTaking(bool by_merit) : by_merit_(by_merit) {}

  // At an accepted state, once: whether the next turn is the rule's.
  bool IsTheRules();

  void RuleStepped(double gain);
  void CeresStepped(double gain);
  void RuleHadNoStep();

 private:
  void Wait();

  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  static constexpr int kFirstWait = 2;
  static constexpr int kLongestWait = 16;
  static constexpr int kMostInARow = 8;

  bool by_merit_;
  double rule_merit_ = kNone;
  double ceres_merit_ = kNone;
  int num_in_a_row_ = 0;    // of the rule's turns
  int num_turns_left_ = 0;  // of Ceres', before the rule's next
  int next_wait_ = kFirstWait;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_TURN_TAKING_H_
