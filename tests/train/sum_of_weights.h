// The average of averaged_weights.h as a sum, for tests.
#ifndef INVGRAD_TESTS_TRAIN_SUM_OF_WEIGHTS_H_
#define INVGRAD_TESTS_TRAIN_SUM_OF_WEIGHTS_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/train/averaged_weights.h"

namespace invgrad {

// Of w_1, w_2, ..., with shares proportional to k (k + 1) ... (k + g - 1).
inline Eigen::VectorXd SumOfWeights(const std::vector<Eigen::VectorXd>& all) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(all[0].size());
  double sum_of_shares = 0.0;
  for (size_t k = 1; k <= all.size(); ++k) {
    double share = 1.0;
    for (int j = 0; j < static_cast<int>(AveragedWeights::kDecay); ++j) {
      share *= static_cast<double>(k) + j;
    }
    sum += share * all[k - 1];
    sum_of_shares += share;
  }
  return sum / sum_of_shares;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_TRAIN_SUM_OF_WEIGHTS_H_
