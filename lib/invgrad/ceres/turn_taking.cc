#include "invgrad/ceres/turn_taking.h"

#include <algorithm>

namespace invgrad {
namespace {

void Average(double gain, std::optional<double>* merit) {
  *merit = *merit ? 0.5 * (**merit + gain) : gain;
}

}  // namespace

bool TurnTaking::IsTheRules() {
  if (num_turns_left_ > 0) {
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

void TurnTaking::RuleStepped(double gain) {
  Average(gain, &rule_merit_);
  if (!by_merit_ || !ceres_merit_ || *rule_merit_ >= *ceres_merit_) {
    next_wait_ = kFirstWait;
  } else {
    Wait();
    // Old gains do not predict the rule's next turn.
    rule_merit_ = gain;
  }
}

void TurnTaking::CeresStepped(double gain) { Average(gain, &ceres_merit_); }

void TurnTaking::RuleHadNoStep() { Wait(); }

void TurnTaking::Wait() {
  num_in_a_row_ = 0;
  num_turns_left_ = next_wait_;
  next_wait_ = std::min(2 * next_wait_, kMaxWait);
}

}  // namespace invgrad
