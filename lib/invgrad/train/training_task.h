// What a training run reads and what it writes, for those that share the work:
// Train (trainer.h), TrainByMethod (method.h) and the minimizers of Ceres
// (ceres_training.h).
#ifndef INVGRAD_TRAIN_TRAINING_TASK_H_
#define INVGRAD_TRAIN_TRAINING_TASK_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/chain/data_set.h"
#include "invgrad/chain/model.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/inverse/inverse_simulator.h"
#include "invgrad/train/history.h"
#include "invgrad/train/trainer.h"

namespace invgrad {

// Nothing is owned but the inverse.
struct TrainingTask {
  const TrainOptions& options;
  const Model& model;
  const DataSet& train;
  const DataSet& test;  // may have no samples
  // The simulator's own, or null.
  std::shared_ptr<const InverseSimulator> inverse;
};

// None of them null.
struct TrainingResults {
  Eigen::VectorXd* weights;  // the initial ones before the run
  History* history;
  TrainSummary* summary;
};

// The checks that are the same whoever trains. CHECKs the sizes of weights and
// data and that there is a budget; false, with *error saying what, for input
// that only running shows to be bad.
bool CheckTrainingInput(const TrainingTask& task,
                        const Eigen::VectorXd& weights,
                        std::string* error);

// All that Train refuses, by the above and because of the rule, but for a
// checkpoint of another run.
bool CheckTraining(const TrainingTask& task,
                   const UpdateRule& rule,
                   const Eigen::VectorXd& weights,
                   std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_TASK_H_
