// Trains a model by a minimizer of Ceres, on all samples at once.
//
// An iteration counts as a step and as an epoch, a rejected one too; the
// history, the budget and the callbacks are those of Train (trainer.h). There
// is no checkpoint: TrainOptions::checkpoint_path, batch_size and the shuffling
// are not used.
//
// Fails:   false, with *error set and nothing done, for bad input, as Train; if
//          the loss is no squared norm and the method a trust region; if a rule
//          cannot propose its steps for this network.
#ifndef INVGRAD_TRAIN_CERES_TRAINING_H_
#define INVGRAD_TRAIN_CERES_TRAINING_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/methods/method.h"
#include "invgrad/train/training_task.h"

namespace invgrad {

// `report`: what there is to say of a rule's proposals, to be added to the
// run's message.
bool TrainByCeres(const Method& method,
                  const TrainingTask& task,
                  const TrainingResults& results,
                  std::string* report,
                  std::string* error);

// The part of the above that finds bad input.
bool CheckCeresTraining(const Method& method,
                        const TrainingTask& task,
                        const Eigen::VectorXd& weights,
                        std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CERES_TRAINING_H_
