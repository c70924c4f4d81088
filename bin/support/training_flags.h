// The flags of the programs that train a network: budget, batches, and settings
// that replace the problem's network. A program has these flags if it uses this
// file.
//
//   hidden=20-20-20        a width a hidden layer
//   activation=relu        linear, tanh, relu, sigmoid, gelu; see activation.h
//   initialization=he      glorot, he, pytorch; see network.h
//   torch_script=FILE      a TorchScript file in place of the network; see
//                          invgrad/torch/torch_script.h
#ifndef BIN_SUPPORT_TRAINING_FLAGS_H_
#define BIN_SUPPORT_TRAINING_FLAGS_H_

#include <string>
#include <vector>

#include "gflags/gflags.h"
#include "invgrad/train.h"
#include "problems/problem.h"

DECLARE_int32(epochs);
DECLARE_int64(steps);
DECLARE_double(seconds);
DECLARE_int32(batch_size);

namespace invgrad {

// Empty text keeps the problem's setting.
struct NetworkSettings {
  std::string hidden;
  std::string activation;
  std::string initialization;
  std::string torch_script = "";

  // Of these fields: as flags and as axes of a sweep.
  static const std::vector<std::string>& Names();
  // The field with this name, or null.
  std::string* Find(const std::string& name);
};

// Replaces the problem's network; inputs, outputs, simulator, loss, data and
// feedback do not change. Returns false with *error "activation=sine is no
// choice; allowed: one of ..." for a setting that is not allowed; the problem
// is then unchanged.
bool SetNetwork(const NetworkSettings& settings,
                LearningProblem* problem,
                std::string* error);

NetworkSettings NetworkOfFlags();

// "20-20-20": replaces the hidden layers of `widths`, unless the text is empty.
// A network's weights are numbered by an int.
bool ParseWidths(const std::string& text,
                 std::vector<int>* widths,
                 std::string* error);

// Returns false, with *error, for a budget or a batch size that is not allowed.
// SetNetwork checks the network's flags.
bool CheckTrainingFlags(std::string* error);

// Sets --epochs to the problem's budget if the flags have none.
void SetDefaultBudget(const LearningProblem& problem);

// With budget, shuffle and checkpoint_seconds of the flags.
TrainOptions TrainOptionsOfFlags(int batch_size, int seed);

}  // namespace invgrad

#endif  // BIN_SUPPORT_TRAINING_FLAGS_H_
