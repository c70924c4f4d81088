// What training needs to hold in memory, estimated before it starts.
//
//   a step     its batch; activations; the simulator's Jacobians (8 m |x|
//              bytes); the Hessian, 8 n^2; what the rule adds
//              (UpdateRule::StepMemory): the factors of J, 8 m sum_l widths[l],
//              a Gram matrix, 8 m^2, ...
//   Ceres      J for all samples at once, 8 m n, as often as its linear solver
//              copies it
//
// and the data. Right to a factor of two or so, not counting what every
// process has; an evaluation of the losses needs less than the data. A rule
// that finds its route as it goes (route=auto) is counted with the cheapest,
// and told so ("at least"): each dearer one is asked for its memory when its
// turn comes, and is then refused or not.
#ifndef INVGRAD_TRAIN_TRAINING_MEMORY_H_
#define INVGRAD_TRAIN_TRAINING_MEMORY_H_

#include <string>
#include <vector>

#include "ceres/types.h"
#include "invgrad/chain/model.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/train/training_task.h"

namespace invgrad {

// A step of Train on batches of `batch_size` samples.
std::vector<MemoryPart> TrainingMemory(const Model& model,
                                       const UpdateRule& rule,
                                       bool through_pull_back,
                                       int batch_size);

// A trust region of Ceres with J of that size.
std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          double rows,
                                          double cols);

// The same of a model, all samples at once; and a line search of Ceres.
std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          const Model& model,
                                          int num_samples);
std::vector<MemoryPart> LineSearchMemory(const Model& model, int num_samples);

// Whether the run of Train, with its data, fits into options.memory_limit;
// false with *error: "batch_size=100000 needs 35 GB (route gram 32 GB, ...".
bool TrainingFits(const TrainingTask& task,
                  const UpdateRule& rule,
                  std::string* error);

// The same of a run by Ceres, whose parts are given.
bool CeresFits(const TrainingTask& task,
               std::vector<MemoryPart> parts,
               std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_MEMORY_H_
