#include "invgrad/train/training_task.h"

#include <cmath>
#include <limits>

#include "glog/logging.h"
#include "invgrad/train/training_memory.h"

namespace invgrad {

bool CheckTrainingInput(const TrainingTask& task,
                        const Eigen::VectorXd& weights,
                        std::string* error) {
  const TrainOptions& options = task.options;
  const int num_samples = task.train.num_samples();
  CHECK_EQ(weights.size(), task.model.num_weights());
  CHECK_GT(num_samples, 0);
  CHECK(options.max_num_epochs < std::numeric_limits<int>::max() ||
        options.max_num_steps < std::numeric_limits<long>::max() ||
        std::isfinite(options.max_time_in_seconds))
      << "a training run needs a budget in epochs, steps or seconds";
  if (options.batch_size < 0 || options.batch_size > num_samples) {
    *error = "batch_size=" + std::to_string(options.batch_size) +
             " is out of range; allowed: 1 to the " +
             std::to_string(num_samples) + " training samples, or 0 for all";
    return false;
  }
  std::string where;
  if (!task.train.IsFinite(&where)) {
    *error = "train data: " + where;
    return false;
  }
  if (!task.test.IsFinite(&where)) {
    *error = "test data: " + where;
    return false;
  }
  if (!weights.allFinite()) {
    *error = "the initial weights are not finite";
    return false;
  }
  return true;
}

bool CheckTraining(const TrainingTask& task,
                   const UpdateRule& rule,
                   const Eigen::VectorXd& weights,
                   std::string* error) {
  if (!CheckTrainingInput(task, weights, error)) return false;
  if (task.options.pull_back != nullptr && rule.JudgesSteps() &&
      task.model.feedback() != nullptr) {
    *error =
        "control=gain: in a closed loop an update moves the inputs of what is "
        "pulled back";
    return false;
  }
  if (task.options.pull_back == nullptr &&
      !task.model.CanLinearize(rule.Needs(), error)) {
    return false;
  }
  return TrainingFits(task, rule, error);
}

}  // namespace invgrad
