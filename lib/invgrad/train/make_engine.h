// Makes the engine of a phase, and finds bad input before anything runs.
//
// A rule works on the model, on the model with a joint loss, or on the proxy of
// a pull-back through the model, as the phase says; a minimizer of Ceres works
// on the model.
//
// Fails:   null, with *error set: a batch size out of range, a method that the
//          model or the data cannot serve (a trust region without a
//          least-squares loss, supervision without solutions, ...), or more
//          memory than there is.
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

// Of a rule object on the model.
std::unique_ptr<Engine> MakeEngine(std::shared_ptr<UpdateRule> rule,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_MAKE_ENGINE_H_
