// Counts the samples of a run by the source of their d_x
// (simulator_pull_back.h).
#ifndef INVGRAD_INVERSE_PULL_BACK_COUNTS_H_
#define INVGRAD_INVERSE_PULL_BACK_COUNTS_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/inverse/simulator_pull_back.h"

namespace invgrad {

class PullBackCounts {
 public:
  // The number of samples with a d_x from this source.
  long of(PullBackSource source) const {
    return static_cast<long>(state_[static_cast<int>(source)]);
  }

  void BeginStep() { ++state_[kNumPullBackSources]; }
  // The result of a sample in the current step.
  void Add(const SimulatorPullBack::Result& result, int sample);

  // "6400 inverse, 12 numerical inverse (first at step 3, sample 17: why)";
  // empty if no sample was inverted.
  std::string Report() const;

  // The counts, for checkpoints, then the bytes of the first failure's text.
  Eigen::VectorXd State() const;
  // Returns false, and changes nothing, if size or bytes do not fit.
  bool SetState(const Eigen::VectorXd& state);

 private:
  // The counts of the sources, then the number of steps.
  Eigen::VectorXd state_ = Eigen::VectorXd::Zero(kNumPullBackSources + 1);
  std::string first_failure_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_PULL_BACK_COUNTS_H_
