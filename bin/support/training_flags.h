// The flags of the programs that train a network: settings of the network,
// budget and batches. A program has these flags if it uses this file.
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

// Returns false for a value that is not allowed; *error names flag, value and
// allowed values. SetNetwork checks the network's flags.
bool CheckTrainingFlags(std::string* error);

NetworkSettings NetworkOfFlags();

// Sets the budget (default: the problem's) and whether to shuffle, but not the
// batch size, which depends on the problem and a sweep's axis.
void ApplyTrainingFlags(const LearningProblem& problem, TrainOptions* options);

}  // namespace invgrad

#endif  // BIN_SUPPORT_TRAINING_FLAGS_H_
