// The budget of a training run in epochs, steps and seconds.
//
// Phases have epochs of their own length, so that a run's epochs are fractions
// that do not add up exactly: a remainder of 1e-12 of the budget is nothing.
#ifndef INVGRAD_TRAIN_BUDGET_H_
#define INVGRAD_TRAIN_BUDGET_H_

#include <limits>
#include <string>

namespace invgrad {

// Where a run stands.
struct RunPosition {
  long step = 0;
  double epoch = 0.0;
  double seconds = 0.0;
};

struct Budget {
  static constexpr int kNoEpochs = std::numeric_limits<int>::max();
  static constexpr long kNoSteps = std::numeric_limits<long>::max();
  static constexpr double kNoSeconds = std::numeric_limits<double>::infinity();
  int max_num_epochs = kNoEpochs;
  long max_num_steps = kNoSteps;
  double max_time_in_seconds = kNoSeconds;

  bool is_finite() const;
  // Empty while something of the budget is left; "epochs done" and the like.
  std::string Spent(const RunPosition& position) const;
  // The share that is spent, in [0, 1].
  double Share(const RunPosition& position) const;
  // The steps of a phase that begins at `position`, until epochs or steps are
  // spent.
  long NumStepsFrom(const RunPosition& position, long steps_per_epoch) const;

 private:
  double EpochsLeft(double epoch) const;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_BUDGET_H_
