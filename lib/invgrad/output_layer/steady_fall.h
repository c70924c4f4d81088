// Whether training still lowers the loss that the best output layer leaves.
// The losses are those of the shares that it is solved on (share.h), or of all
// samples.
//
//   a_1, a_2, a_3:  the mean log loss while the spent share of the budget is in
//                   [1/80, 1/40), [1/40, 1/20) and [1/20, 1/10)
//   stalled:        from 1/10 on, unless a_2 < a_1 + log 0.85
//                                    and a_3 < a_2 + log 0.85
//
// Where features are nearly dependent the best layer is large. The gradients of
// single samples by the other weights are as large, and cancel in their sum, so
// that a batch has mostly noise: such a run has a low loss after its first
// solution, and then jumps, but does not fall steadily.
// docs/results/exact_output_layer.md has both kinds of runs.
//
// Edges:   intervals with fewer than least_count losses count as falling. A
//          loss of 0 counts as the smallest number, one that is not finite as
//          the largest.
#ifndef INVGRAD_OUTPUT_LAYER_STEADY_FALL_H_
#define INVGRAD_OUTPUT_LAYER_STEADY_FALL_H_

#include <algorithm>
#include <cmath>
#include <limits>

#include "Eigen/Core"

namespace invgrad {

class SteadyFall {
 public:
  // For losses of shares, which differ, and of all samples.
  static constexpr int kLeastCountOfShares = 3;
  static constexpr int kLeastCountOfAll = 1;

  static constexpr int kNumShares = 3;
  static constexpr double kStart = 1.0 / 80.0;
  // The share of the budget after which the fall is judged.
  static constexpr double kEnd = kStart * (1 << kNumShares);

  explicit SteadyFall(int least_count) : least_count_(least_count) {}

  // spent: the share of the budget before the step that has this loss.
  static bool Reads(double spent) { return spent >= kStart && spent < kEnd; }
  void Add(double spent, double loss) {
    if (!Reads(spent)) return;
    constexpr double kLargest = std::numeric_limits<double>::max();
    const double limited =
        loss <= kLargest ? std::max(loss, std::numeric_limits<double>::min())
                         : kLargest;
    int share = 0;
    while (spent >= 2.0 * kStart * (1 << share)) ++share;
    state_[2 * share] += std::log(limited);
    state_[2 * share + 1] += 1.0;
  }

  bool HasStalled(double spent) const {
    return spent >= kEnd && (!HasFallen(1) || !HasFallen(2));
  }

  // For each share the sum of the log losses and their number.
  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  static constexpr double kFall = 0.85;

  // From the share before to this one.
  bool HasFallen(int share) const {
    const double count = state_[2 * share + 1];
    const double count_before = state_[2 * share - 1];
    if (std::min(count, count_before) < least_count_) return true;
    return state_[2 * share] / count <
           state_[2 * share - 2] / count_before + std::log(kFall);
  }

  double least_count_;
  Eigen::VectorXd state_ = Eigen::VectorXd::Zero(2 * kNumShares);
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_STEADY_FALL_H_
