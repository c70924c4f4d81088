// Running means of the weights of a training run on mini-batches.
//
//   mean_h <- mean_h + (weights - mean_h) / h    after each step, h = 3, 10, 30
//
// Each step fits its own batch, and so the last weights have the noise of the
// last batches. mean_h begins with the weights after the first step. It has
// 1 / (2 h - 1) of the variance of noise that is independent from step to step,
// and is h - 1 steps behind weights that grow steadily. Which mean is better than
// the last weights, if any, has to be measured (raced_engine.h).
//
// Cost: 3 n operations and n weights for each mean. A race of batch sizes keeps
//   up to six sets of means.
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
  static constexpr std::array<double, 3> kHorizons = {3.0, 10.0, 30.0};

  void Add(const Eigen::VectorXd& weights) {
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      if (means_[i].size() == 0) means_[i] = weights;
      means_[i] += (weights - means_[i]) / kHorizons[i];
    }
  }

  // By horizon; empty before the first step.
  const std::array<Eigen::VectorXd, 3>& means() const { return means_; }
  bool has_means() const { return means_[0].size() > 0; }

  void VisitState(const std::string& prefix,
                  Eigen::Index num_weights,
                  StateArchive* archive) {
    for (size_t i = 0; i < kHorizons.size(); ++i) {
      const std::string name = fmt::format("{}mean_{}", prefix, i);
      archive->Visit(name, &means_[i]);
      const Eigen::Index size = means_[i].size();
      archive->Require((size == 0 || size == num_weights) &&
                           size == means_[0].size() && means_[i].allFinite(),
                       name);
    }
  }

 private:
  std::array<Eigen::VectorXd, 3> means_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_WEIGHT_MEANS_H_
