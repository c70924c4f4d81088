// The budget of a training run in epochs, steps and seconds.
//
// Epochs of different phases differ in length, so sums of epochs have rounding
// errors: a remainder of 1e-12 of the budget counts as zero.
#ifndef INVGRAD_TRAIN_BUDGET_H_
#define INVGRAD_TRAIN_BUDGET_H_

#include <limits>
#include <string>

namespace invgrad {

// The position of a run.
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
  // Empty while some budget is left; then a reason such as "epochs done".
  std::string Spent(const RunPosition& position) const;
  // The share that is spent, in [0, 1].
  double Share(const RunPosition& position) const;
  // The number of steps of a phase that begins at `position`, limited by epochs
  // and steps.
  long NumStepsFrom(const RunPosition& position, long steps_per_epoch) const;

 private:
  double EpochsLeft(double epoch) const;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_BUDGET_H_
