// Running means of the weights of a training run on mini-batches.
//
//   mean_h <- mean_h + (weights - mean_h) / h    after each step, h = 3, 10, 30
//
// Each step fits the noise of its own batch, and the last weights have the noise
// of the last batches. A mean over about h steps has less of it, the longer the
// less, but it lags behind weights that still improve. Which of them has the
// lowest loss is measured (raced_engine.h); no step begins from a mean.
//
// Cost: 3 n operations a step for each mean, and three arrays of n weights.
// Source: Polyak, Juditsky. Acceleration of stochastic approximation by
//   averaging. SIAM J. Control Optim. 30, 1992; with exponential weights, which
//   forget the first steps.
#ifndef INVGRAD_TRAIN_WEIGHT_MEANS_H_
#define INVGRAD_TRAIN_WEIGHT_MEANS_H_

#include <array>
#include <string>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/train/checkpoint.h"

namespace invgrad {

class WeightMeans {
 public:
  void Add(const Eigen::VectorXd& weights) {
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      if (means_[i].size() == 0) means_[i] = weights;
      means_[i] += (weights - means_[i]) / kHorizons[i];
    }
  }

  // False before the first step.
  bool has_means() const { return means_[0].size() > 0; }
  // From the shortest to the longest.
  const std::array<Eigen::VectorXd, 3>& means() const { return means_; }

  void VisitState(const std::string& name, StateArchive* archive) {
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      const std::string full_name = fmt::format("{}mean_{}", name, i);
      archive->Visit(full_name, &means_[i]);
      archive->Require(means_[i].allFinite(), full_name);
    }
  }

 private:
  static constexpr std::array<double, 3> kHorizons = {3.0, 10.0, 30.0};

  std::array<Eigen::VectorXd, 3> means_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_WEIGHT_MEANS_H_
