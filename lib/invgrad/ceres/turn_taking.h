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

#include <algorithm>
#include <optional>

namespace invgrad {

class TurnTaking {
 public:
  // by_merit = false: the rule has every turn for which it has a step.
  explicit TurnTaking(bool by_merit) : by_merit_(by_merit) {}

  // Returns whether the next turn is the rule's. Call once after each accepted
  // step.
  bool IsTheRules() {
    is_waiting_ = num_turns_left_ > 0;
    if (is_waiting_) {
      --num_turns_left_;
      return false;
    }
    if (!by_merit_ || !rule_merit_) return true;
    if (!ceres_merit_) return false;
    if (num_in_a_row_ >= kMaxInARow) {
      num_in_a_row_ = 0;
      return false;
    }
    ++num_in_a_row_;
    return true;
  }

  // Whether this turn is Ceres' because the last one of the rule was in vain.
  bool IsRuleWaiting() const { return is_waiting_ || num_turns_left_ > 0; }

  void RuleStepped(double gain) {
    Average(gain, &rule_merit_);
    if (!by_merit_ || !ceres_merit_ || *rule_merit_ >= *ceres_merit_) {
      next_wait_ = kFirstWait;
    } else {
      RuleHadNoStep();
      // Old gains do not predict the rule's next turn.
      rule_merit_ = gain;
    }
  }

  void CeresStepped(double gain) { Average(gain, &ceres_merit_); }

  void RuleHadNoStep() {
    num_in_a_row_ = 0;
    num_turns_left_ = next_wait_;
    next_wait_ = std::min(2 * next_wait_, kMaxWait);
  }

 private:
  static void Average(double gain, std::optional<double>* merit) {
    *merit = *merit ? 0.5 * (**merit + gain) : gain;
  }

  static constexpr int kFirstWait = 2;
  static constexpr int kMaxWait = 16;
  static constexpr int kMaxInARow = 8;

  bool by_merit_;
  std::optional<double> rule_merit_;  // none before its first step
  std::optional<double> ceres_merit_;
  int num_in_a_row_ = 0;    // of the rule's turns
  int num_turns_left_ = 0;  // of Ceres, before the rule's next
  int next_wait_ = kFirstWait;
  bool is_waiting_ = false;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_TURN_TAKING_H_
