// The large arrays of training, estimated before it starts: m = B |y| rows of J.
//
//   a step     activations; the factors of J, 8 m sum_l widths[l] bytes; a Gram
//              matrix or a Hessian (step_cost.h); what simulator and loss give
//              for each sample
//   Ceres      J of all samples, and what the linear solver makes of it
//              (TrustRegionMemory)
//
// and the data. Accurate to about a factor of two, without the memory that
// every process has; an evaluation of the losses needs less than the data.
#ifndef INVGRAD_TRAIN_TRAINING_MEMORY_H_
#define INVGRAD_TRAIN_TRAINING_MEMORY_H_

#include <vector>

#include "invgrad/core/memory_limit.h"
#include "invgrad/linearization.h"
#include "invgrad/method.h"
#include "invgrad/model.h"

namespace invgrad {

double DataBytes(const DataSet& data);

// A step of a rule on batches of `batch_size` samples, of each of the ranks that
// share them.
std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const LinearizationParts& needs,
                                       bool through_pull_back,
                                       int batch_size,
                                       int num_ranks = 1);

// Copies of the matrices that the rule keeps from step to step.
std::vector<MemoryPart> CopiesOfState(const LinearizationParts& needs,
                                      int num_weights,
                                      bool is_raced,
                                      bool has_checkpoint);

// A phase by Ceres.
std::vector<MemoryPart> CeresMemory(const Phase& phase,
                                    const Model& model,
                                    int num_samples);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_MEMORY_H_
