// Finds the batch size of a training run by races at equal cost.
//
//   8 steps with B = B_0
//   repeat
//     steps with B until the work has grown by a quarter
//     race: for b = B, 4 B or 2 B, B / 4
//       from the same weights and the same state of the rule:
//       steps with b samples, until 3 % of the work so far is done
//     the slice with the lowest loss on samples that no slice used goes on:
//     B, the weights and the state of the rule are those of the slice; the
//     loss of a larger batch counts f times
//
// Small batches are cheap and make fast progress early; large ones have less
// noise, and a Jacobian with more rows, which pays late. Which is better now is
// measured, not predicted.
//
//   f                the factor by which the loss of the run has fallen since it
//                    was last measured for a race, at least 1 and at most b / B.
//                    With a larger batch the noise of the loss falls at once, and
//                    only once, while its rate may be lower: this gain can wait
//                    until the run stalls. Noise falls by no more than b / B, so
//                    a larger gain is one of rate.
//   B_0              the batch size of the run, or as many samples as have 2,048
//                    outputs where a rule that factorizes J would have more rows
//                    and more weights than that (engine.cc)
//   smaller batches  never below B_0 samples, and only after the work has grown
//                    fourfold since the last one was tried
//   larger batches   4 B, or else 2 B, if four steps with them cost at most a
//                    tenth of all work so far, and fit in memory
//   going back       where a race begins or ends with a loss above ten times the
//                    lowest of earlier ones, and above ten times the loss that
//                    those weights have on the same samples: the run goes back to
//                    them and to the state that the rule had there
//   cost             a race begins when earlier ones are a fifth of all work
//
// Units:   work is a count of operations, from sizes: the same run repeats bit
//          for bit on any machine, and a resumed one continues inside a race.
// The class decides; the caller (raced_engine.cc) moves weights and states.
#ifndef INVGRAD_TRAIN_BATCH_RACE_H_
#define INVGRAD_TRAIN_BATCH_RACE_H_

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "invgrad/train/checkpoint.h"

namespace invgrad {

class BatchRace {
 public:
  struct Costs {
    std::function<double(int batch_size)> of_step;  // work
    double of_judgement = 0.0;  // of one loss on the samples that judge
    // Whether a batch fits in memory; if not, *why says how much it needs.
    std::function<bool(int batch_size, std::string* why)> fits;
  };

  BatchRace(int first_batch_size, int num_samples, Costs costs);

  // Of the next step.
  int batch_size() const { return is_racing() ? sizes_[lane_] : path_.back(); }
  bool is_racing() const { return !sizes_.empty(); }
  // The slice that runs; 0 is the run as it goes on without a race.
  int lane() const { return lane_; }

  // What the run does where a race begins or ends with `loss`, of new samples.
  // `of_lowest` returns the loss of the weights of lowest_loss() on these.
  enum class Verdict { kGoesOn, kGoesBack, kIsLowest };
  Verdict Decide(double loss, const std::function<double()>& of_lowest);
  double lowest_loss() const { return lowest_loss_; }

  // Whether a race may begin before the next step.
  bool IsDue() const { return !is_racing() && work_ >= next_race_; }
  // `loss`: of new samples. Returns false if there is only one size to try.
  bool Begin(double loss);
  // After a step with batch_size().
  void CountStep();
  bool IsSliceOver() const { return is_racing() && work_ >= end_of_slice_; }
  // Returns false after the last slice.
  bool BeginNextSlice();
  // The losses of the slices on new samples; infinite for one that failed.
  // Returns the slice that goes on.
  int End(const std::vector<double>& losses);

  // "batch size 32, 128, 512"; why it cannot grow, if it meets a limit; and how
  // often the run went back.
  std::string Report() const;

  void VisitState(StateArchive* archive);

 private:
  void BeginSlice() { end_of_slice_ = work_ + slice_; }
  // The last size, times a factor, at most all samples.
  int Times(int factor) const;
  // The size to try beside the last one; 0: none.
  int Larger();
  int Smaller();

  const int first_batch_size_;
  const int num_samples_;
  const Costs costs_;

  std::vector<int> path_;  // all batch sizes, in turn
  double work_ = 0.0;
  double next_race_ = 0.0;
  double next_smaller_ = 0.0;
  double last_loss_ = 0.0;
  double lowest_loss_ = std::numeric_limits<double>::infinity();
  long num_returns_ = 0;

  // Of a race.
  std::vector<int> sizes_;
  int lane_ = 0;
  double slice_ = 0.0;
  double end_of_slice_ = 0.0;
  double begin_ = 0.0;  // the work before it
  double fall_ = 1.0;   // of the loss before it
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_BATCH_RACE_H_
