#include "invgrad/train/averaged_weights.h"

#include <utility>

#include "invgrad/train/checkpoint.h"

namespace invgrad {

void AveragedWeights::Add(const Eigen::VectorXd& weights) {
  Eigen::VectorXd average = With(weights);
  if (!average.allFinite()) return;
  average_ = std::move(average);
  ++num_added_;
}

Eigen::VectorXd AveragedWeights::With(const Eigen::VectorXd& weights) const {
  if (num_added_ == 0) return weights;
  const double share =
      (kDecay + 1.0) / (static_cast<double>(num_added_) + 1.0 + kDecay);
  return average_ + share * (weights - average_);
}

void AveragedWeights::VisitState(StateArchive* archive,
                                 Eigen::Index size,
                                 long max_num_added) {
  archive->Visit("num_averaged", &num_added_);
  archive->Require(num_added_ <= max_num_added, "num_averaged");
  archive->Visit("average", &average_, num_added_ > 0 ? size : 0);
  archive->Require(average_.allFinite(), "average");
}

}  // namespace invgrad
