#include "bin/support/training_flags.h"

#include <cmath>

#include "bin/support/program.h"

DEFINE_string(hidden,
              "",
              "widths of the network's hidden layers, as 20-20-20; empty: the "
              "problem's own");
DEFINE_string(activation,
              "",
              "of the hidden layers: linear, tanh, relu, sigmoid, gelu; empty: "
              "the problem's own");
DEFINE_string(initialization,
              "",
              "of the weights: glorot, he, pytorch; empty: the problem's own");
DEFINE_int32(epochs, 0, "budget in epochs; 0: the problem's own if no other");
DEFINE_int64(steps, 0, "budget in steps; 0: none");
DEFINE_double(seconds, 0.0, "budget in seconds of training; 0: none");
DEFINE_int32(batch_size, -1, "samples a step; 0: all; -1: the problem's own");
DEFINE_bool(shuffle, false, "a new order of the samples each epoch");

namespace invgrad {

bool CheckTrainingFlags(std::string* error) {
  return CheckFlag("epochs", FLAGS_epochs >= 0, "0 (none) or more", error) &&
         CheckFlag("steps", FLAGS_steps >= 0, "0 (none) or more", error) &&
         CheckFlag("seconds",
                   FLAGS_seconds >= 0.0 && std::isfinite(FLAGS_seconds),
                   "0 (none) or more",
                   error) &&
         CheckFlag("batch_size",
                   FLAGS_batch_size >= -1,
                   "-1 (the problem's own), 0 (all), or more",
                   error);
}

NetworkSettings NetworkOfFlags() {
  return {FLAGS_hidden, FLAGS_activation, FLAGS_initialization};
}

void ApplyTrainingFlags(const LearningProblem& problem, TrainOptions* options) {
  options->shuffle = FLAGS_shuffle;
  if (FLAGS_epochs > 0) options->max_num_epochs = FLAGS_epochs;
  if (FLAGS_steps > 0) options->max_num_steps = FLAGS_steps;
  if (FLAGS_seconds > 0.0) options->max_time_in_seconds = FLAGS_seconds;
  if (FLAGS_epochs == 0 && FLAGS_steps == 0 && FLAGS_seconds == 0.0) {
    options->max_num_epochs = problem.num_epochs;
  }
}

}  // namespace invgrad
