// Whether training still lowers the loss that the best output layer leaves.
//
//   a_1, a_2:  the mean log loss while the spent share of the budget is in
//              [1/40, 1/20) and in [1/20, 1/10)
//   stalled:   from 1/10 on, if a_2 >= a_1 + log 0.85
//
// Where features are nearly dependent the best layer is large. The gradients of
// single samples by the other weights are as large, and cancel in their sum, so
// that a batch has mostly noise: such a run has a low loss after its first
// solution, and never a much lower one. docs/results/exact_output_layer.md has
// both kinds of runs.
//
// Edges:   with fewer than 4 losses in one of the shares it has not stalled. A
//          loss of 0 counts as the smallest number, one that is not finite as the
//          largest.
#ifndef INVGRAD_OUTPUT_LAYER_LOSS_TREND_H_
#define INVGRAD_OUTPUT_LAYER_LOSS_TREND_H_

#include <algorithm>
#include <cmath>
#include <limits>

#include "Eigen/Core"

namespace invgrad {

class LossTrend {
 public:
  // spent: the share of the budget before the step that has this loss.
  void Add(double spent, double loss) {
    if (spent < kStart || spent >= 4.0 * kStart) return;
    constexpr double kLargest = std::numeric_limits<double>::max();
    const double limited =
        loss <= kLargest ? std::max(loss, std::numeric_limits<double>::min())
                         : kLargest;
    const int share = spent < 2.0 * kStart ? 0 : 1;
    state_[2 * share] += std::log(limited);
    state_[2 * share + 1] += 1.0;
  }

  bool HasStalled(double spent) const {
    if (spent < 4.0 * kStart) return false;
    if (state_[1] < kLeastCount || state_[3] < kLeastCount) return false;
    return state_[2] / state_[3] >= state_[0] / state_[1] + std::log(kFall);
  }

  // For each share the sum of the log losses and their number.
  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  static constexpr double kStart = 1.0 / 40.0;
  static constexpr double kLeastCount = 4.0;
  static constexpr double kFall = 0.85;

  Eigen::VectorXd state_ = Eigen::Vector4d::Zero();
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_LOSS_TREND_H_
