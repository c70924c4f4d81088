// The average of the weights of a training phase, in which the last ones count
// most (polynomial decay): after weights w_k, k = 1, 2, ...,
//
//   w_bar += (g + 1) / (k + g) (w_k - w_bar),   g = 8
//
// so that w_1 alone has the average w_1, and after K weights w_k has the weight
//
//   (g + 1) / (K + g) prod_{j = k+1..K} (j - 1) / (j + g)
//     = (g + 1) k (k + 1) ... (k + g - 1) / (K (K + 1) ... (K + g))
//
// in it, about (g + 1) k^g / K^(g + 1). Steps along noisy gradients end at a
// distance from the minimum; the average of where they have been is nearer.
//
// Cost:    n doubles, and for a moment n more; 3 n operations.
// Fails:   weights that would make w_bar infinite or NaN are left out.
// Source:  Shamir, Zhang. Stochastic Gradient Descent for Non-smooth
//          Optimization. ICML 2013, section 4.
#ifndef INVGRAD_TRAIN_AVERAGED_WEIGHTS_H_
#define INVGRAD_TRAIN_AVERAGED_WEIGHTS_H_

#include "Eigen/Core"

namespace invgrad {

class StateArchive;

class AveragedWeights {
 public:
  static constexpr double kDecay = 8.0;  // g

  void Add(const Eigen::VectorXd& weights);
  // What w_bar is after Add(weights), which this is not; finite or not.
  Eigen::VectorXd With(const Eigen::VectorXd& weights) const;

  long num_weights_added() const { return num_added_; }
  // n; empty before the first Add.
  const Eigen::VectorXd& average() const { return average_; }

  // size: n; max_num_added: the number of steps.
  void VisitState(StateArchive* archive, Eigen::Index size, long max_num_added);

 private:
  long num_added_ = 0;
  Eigen::VectorXd average_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_AVERAGED_WEIGHTS_H_
