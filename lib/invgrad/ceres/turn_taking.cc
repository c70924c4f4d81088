#include "invgrad/ceres/turn_taking.h"

#include <algorithm>
#include <cmath>

namespace invgrad {
namespace {

void Average(double gain, double* merit) {
  *merit = std::isnan(*merit) ? gain : 0.5 * (*merit + gain);
}

}  // namespace

bool TurnTaking::IsTheRules() {
  if (num_turns_left_ > 0) {
    --num_turns_left_;
    return false;
  }
  if (!by_merit_ || std::isnan(rule_merit_)) return true;
  if (std::isnan(ceres_merit_)) return false;
  if (num_in_a_row_ >= kMostInARow) {
    num_in_a_row_ = 0;
    return false;
  }
  ++num_in_a_row_;
  return true;
}

void TurnTaking::RuleStepped(double gain) {
  Average(gain, &rule_merit_);
  if (!by_merit_ || std::isnan(ceres_merit_) || rule_merit_ >= ceres_merit_) {
    next_wait_ = kFirstWait;
  } else {
    Wait();
    // What it was long ago says nothing about its next turn.
    rule_merit_ = gain;
  }
}

void TurnTaking::CeresStepped(double gain) { Average(gain, &ceres_merit_); }

void TurnTaking::RuleHadNoStep() { Wait(); }

void TurnTaking::Wait() {
  num_in_a_row_ = 0;
  num_turns_left_ = next_wait_;
  next_wait_ = std::min(2 * next_wait_, kLongestWait);
}

}  // namespace invgrad
