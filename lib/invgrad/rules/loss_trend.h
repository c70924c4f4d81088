// The trend of the loss of new samples: a straight line through log L against
// the step, by least squares with exponentially decreasing weights.
//
//   min over slope, level of  sum_k (1 - 1 / T)^k (log L_k - level + slope k)^2,
//   k = 0, 1, ... steps ago,   T = 50
//
// Each batch has the loss L before its own step, so the rule has not seen its
// samples since at least an epoch.
//
// Units:   slope: 1 / step, negative while the loss falls. Independent of the
//          units of L.
// Cost:    O(1) a step.
// Fails:   never; known() is false for the first 10 losses.
#ifndef INVGRAD_RULES_LOSS_TREND_H_
#define INVGRAD_RULES_LOSS_TREND_H_

#include "Eigen/Core"

namespace invgrad {

class LossTrend {
 public:
  // The loss must be finite; from 1e-300 down it counts as 1e-300.
  void Add(double loss);
  void Restart() { state_.setZero(); }

  bool known() const { return state_[kCount] >= 10.0; }
  // CHECK known().
  double slope() const;
  // The standard error of the slope, for independent residuals of equal size.
  double slope_error() const;
  // Whether the next loss lies above the line by more than log 2 and by more
  // than 2.5 standard deviations.
  bool IsOutlier(double loss) const;

  Eigen::VectorXd* mutable_state() { return &state_; }

 private:
  enum { kCount, kWeight, kTime, kTime2, kLog, kTimeLog, kLog2, kSize };
  struct Line {
    double slope;
    double level;     // at the last loss
    double variance;  // of the residuals
    double slope_variance;
  };
  Line Fit() const;

  // The number of losses, and weighted sums of 1, t, t^2, l, t l, l^2 with the
  // time t = -k and l = log L.
  Eigen::VectorXd state_ = Eigen::VectorXd::Zero(kSize);
};

}  // namespace invgrad

#endif  // INVGRAD_RULES_LOSS_TREND_H_
