// Makes the engine of a phase, and validates its input.
//
// Depending on the phase, a rule lowers the loss of the model, a joint loss, or
// the proxy of a pull-back through the model; a minimizer of Ceres lowers the
// loss.
//
// Fails:   null, with *error set: a batch size out of range, a method that does
//          not fit the model or the data (a trust region without a
//          least-squares loss, supervised training without solutions, ...), or
//          too little memory.
#ifndef INVGRAD_TRAIN_MAKE_ENGINE_H_
#define INVGRAD_TRAIN_MAKE_ENGINE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/chain/model.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/methods/method.h"
#include "invgrad/train/train.h"

namespace invgrad {

// Model and data must outlive the engine. `weights`: the initial ones.
std::unique_ptr<Engine> MakeEngine(const Phase& phase,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   const Eigen::VectorXd& weights,
                                   std::string* error);

// The engine of a rule object on the model.
std::unique_ptr<Engine> MakeEngine(std::shared_ptr<UpdateRule> rule,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_MAKE_ENGINE_H_
