#include "invgrad/train/budget.h"

#include <algorithm>
#include <cmath>

namespace invgrad {

bool Budget::is_finite() const {
  return max_num_epochs < kNoEpochs || max_num_steps < kNoSteps ||
         max_time_in_seconds < kNoSeconds;
}

double Budget::EpochsLeft(double epoch) const {
  constexpr double kRounding = 1e-12;
  return max_num_epochs * (1.0 - kRounding) - epoch;
}

std::string Budget::Spent(const RunPosition& position) const {
  if (EpochsLeft(position.epoch) <= 0.0) return "epochs done";
  if (position.step >= max_num_steps) return "steps done";
  if (position.seconds >= max_time_in_seconds) return "time used up";
  return "";
}

double Budget::Share(const RunPosition& position) const {
  return std::min(1.0,
                  std::max({position.epoch / max_num_epochs,
                            static_cast<double>(position.step) /
                                static_cast<double>(max_num_steps),
                            position.seconds / max_time_in_seconds}));
}

long Budget::NumStepsFrom(const RunPosition& position,
                          long steps_per_epoch) const {
  long steps = kNoSteps;
  if (max_num_steps < kNoSteps) steps = max_num_steps - position.step;
  if (max_num_epochs < kNoEpochs) {
    // A step within an epoch may reach the budget.
    const double by_epochs = std::ceil(EpochsLeft(position.epoch) *
                                       static_cast<double>(steps_per_epoch));
    steps = std::min(steps, static_cast<long>(by_epochs));
  }
  return steps;
}

}  // namespace invgrad
