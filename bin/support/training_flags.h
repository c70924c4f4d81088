// The flags of the programs that train a network: budget, batches, and settings
// that replace the problem's network.
//
//   hidden=20-20-20        a width a hidden layer
//   activation=relu        linear, tanh, relu, sigmoid, gelu; see activation.h
//   initialization=he      glorot, he, pytorch; see network.h
//   torch_script=FILE      a TorchScript file in place of the network; see
//                          torch_network.h
#ifndef BIN_SUPPORT_TRAINING_FLAGS_H_
#define BIN_SUPPORT_TRAINING_FLAGS_H_

#include <cstdint>
#include <string>
#include <vector>

#include "invgrad/compare/problem.h"
#include "invgrad/minimize.h"
#include "invgrad/train.h"

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

// "20-20-20": replaces the hidden layers of `widths`, unless the text is empty.
// A network's weights are numbered by an int.
bool ParseWidths(const std::string& text,
                 std::vector<int>* widths,
                 std::string* error);

struct TrainingFlags {
  NetworkSettings network;
  int epochs = 0;  // of the budget, 0: none
  std::int64_t steps = 0;
  double seconds = 0.0;
  bool cpu_time = false;
  int batch_size = -1;
  int threads = 1;
  bool shuffle = false;
  double checkpoint_seconds = TrainOptions().checkpoint_interval_in_seconds;

  // Adds a flag for each field, under its name; or only those for the network's
  // widths, the clock and the threads.
  void Add();
  void AddShared();

  // Returns false, with *error, for a budget or a batch size that is not
  // allowed. SetNetwork checks the network's flags.
  bool Check(std::string* error) const;

  // Sets `epochs` to the problem's budget if there is no other.
  void SetDefaultBudget(const LearningProblem& problem);

  // Sets the steps and seconds of a minimization that are not 0.
  void SetBudget(MinimizerOptions* options) const;

  // "6 s of training", or what ends first of several.
  std::string BudgetText() const;

  // With everything but the network and batch_size, which a run may have of its
  // own.
  TrainOptions Options(int batch_size_of_run, int seed) const;
};

// For a problem without a network: returns false, with *error, if a flag of the
// program is given that is for training, or more steps than a minimizer counts.
bool CheckNoTraining(bool takes_threads, std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_TRAINING_FLAGS_H_
