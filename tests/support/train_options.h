// Options of short training runs, for tests.
#ifndef INVGRAD_TESTS_SUPPORT_TRAIN_OPTIONS_H_
#define INVGRAD_TESTS_SUPPORT_TRAIN_OPTIONS_H_

#include <limits>
#include <vector>

#include "ceres/iteration_callback.h"
#include "invgrad/train.h"

namespace invgrad {

// batch_size = 0: all samples.
inline TrainOptions Epochs(int num_epochs, int batch_size = 0) {
  TrainOptions options;
  options.max_num_epochs = num_epochs;
  options.batch_size = batch_size;
  return options;
}

// Records the iterations, and ends the run at one of them.
class StopAt final : public ceres::IterationCallback {
 public:
  explicit StopAt(
      int step = std::numeric_limits<int>::max(),
      ceres::CallbackReturnType verdict = ceres::SOLVER_TERMINATE_SUCCESSFULLY)
      : step_(step), verdict_(verdict) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    steps.push_back(iteration.iteration);
    seconds.push_back(iteration.cumulative_time_in_seconds);
    return iteration.iteration == step_ ? verdict_ : ceres::SOLVER_CONTINUE;
  }
  std::vector<int> steps;
  std::vector<double> seconds;

 private:
  int step_;
  ceres::CallbackReturnType verdict_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_TRAIN_OPTIONS_H_
