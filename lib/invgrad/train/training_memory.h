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

// Whether a step of a rule on batches of that size fits into `limit` (0: that
// of memory_limit.h), with the data; if not, *error says what needs how much:
// "batch_size=100000 needs 35 GB (route gram 32 GB, ...".
bool TrainingFits(const Model& model,
                  const TrainingData& data,
                  const UpdateRule& rule,
                  bool through_pull_back,
                  int batch_size,
                  double limit,
                  std::string* error);

// The same of a phase by Ceres, on all samples at once.
bool CeresFits(const Phase& phase,
               const Model& model,
               const TrainingData& data,
               double limit,
               std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_TRAINING_MEMORY_H_
