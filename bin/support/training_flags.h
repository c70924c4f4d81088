// The flags of the programs that train a network: the network, where it is not
// the problem's own, the budget and the batches. A program has them if it uses
// something of this file.
#ifndef BIN_SUPPORT_TRAINING_FLAGS_H_
#define BIN_SUPPORT_TRAINING_FLAGS_H_

#include <string>

#include "bin/support/network_settings.h"
#include "gflags/gflags.h"
#include "invgrad/train/train.h"
#include "problems/problem.h"

DECLARE_string(hidden);
DECLARE_string(activation);
DECLARE_string(initialization);
DECLARE_int32(epochs);
DECLARE_int64(steps);
DECLARE_double(seconds);
DECLARE_int32(batch_size);
DECLARE_bool(shuffle);

namespace invgrad {

// False with *error naming flag, value and what is allowed. The network's flags
// are checked by SetNetwork.
bool CheckTrainingFlags(std::string* error);

NetworkSettings NetworkOfFlags();

// Sets the budget, the problem's own if there is none, and whether to shuffle;
// not the batch size, of which the problem and a sweep's axis know.
void ApplyTrainingFlags(const LearningProblem& problem, TrainOptions* options);

}  // namespace invgrad

#endif  // BIN_SUPPORT_TRAINING_FLAGS_H_
