// Estimates the memory of training before it starts.
//
//   a step     its batch; activations; the simulator's Jacobians (8 m |x|
//              bytes); the Hessian, 8 n^2; the memory of the rule
//              (UpdateRule::StepMemory): the factors of J, 8 m sum_l widths[l],
//              a Gram matrix, 8 m^2, ...
//   Ceres      J of all samples, and what the linear solver makes of it
//              (TrustRegionMemory)
//
// and the data. Accurate to about a factor of two, without the memory that
// every process has; an evaluation of the losses needs less than the data.
// route=auto counts with the cheapest route, and the message then says "at
// least"; a step that needs a more expensive route checks the memory again.
#ifndef INVGRAD_TRAIN_TRAINING_MEMORY_H_
#define INVGRAD_TRAIN_TRAINING_MEMORY_H_

#include <vector>

#include "invgrad/chain/model.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/methods/method.h"

namespace invgrad {

double DataBytes(const DataSet& data);

// A step of a rule on batches of `batch_size` samples.
// Of each of the ranks that share the batches.
std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const UpdateRule& rule,
                                       bool through_pull_back,
                                       int batch_size,
                                       int num_ranks = 1);

// A phase by Ceres.
std::vector<MemoryPart> CeresMemory(const Phase& phase,
                                    const Model& model,
                                    int num_samples);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_MEMORY_H_
