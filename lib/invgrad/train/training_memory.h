// Estimates the memory of training before it starts.
//
//   a step     its batch; activations; the simulator's Jacobians (8 m |x|
//              bytes); the Hessian, 8 n^2; the memory of the rule
//              (UpdateRule::StepMemory): the factors of J, 8 m sum_l widths[l],
//              a Gram matrix, 8 m^2, ...
//   Ceres J for all samples at once, 8 m n, for each copy in the linear solver
//
// and the data. Accurate to about a factor of two, without the memory that
// every process has; an evaluation of the losses needs less than the data.
// route=auto counts with the cheapest route, and the message then says "at
// least"; a step that needs a more expensive route checks the memory again.
#ifndef INVGRAD_TRAIN_TRAINING_MEMORY_H_
#define INVGRAD_TRAIN_TRAINING_MEMORY_H_

#include <string>
#include <vector>

#include "invgrad/chain/model.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/train/train.h"

namespace invgrad {

// A step of a rule on batches of `batch_size` samples.
std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const UpdateRule& rule,
                                       bool through_pull_back,
                                       int batch_size);

// Whether a step of a rule on batches of this size, with the data, fits into
// `limit` (0: the limit of memory_limit.h); if not, *error lists the parts and
// their sizes: "batch_size=100000 needs 35 GB (route gram 32 GB, ...".
bool TrainingFits(const Model& model,
                  const TrainingData& data,
                  const UpdateRule& rule,
                  bool through_pull_back,
                  int batch_size,
                  double limit,
                  std::string* error);

// The same for a phase by Ceres, on all samples at once.
bool CeresFits(const Phase& phase,
               const Model& model,
               const TrainingData& data,
               double limit,
               std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_MEMORY_H_
