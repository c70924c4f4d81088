// The network of a run where it is not the problem's own: widths and activation
// of its hidden layers, and how its weights are drawn.
//
//   hidden=20-20-20        a width a hidden layer
//   activation=relu        linear, tanh, relu, sigmoid, gelu; see activation.h
//   initialization=he      glorot, he, pytorch; see dense_network.h
//
// Inputs, outputs, simulator, loss, data and a loop over time stay the
// problem's; empty text stands for its own network as well.
#ifndef BIN_SUPPORT_NETWORK_SETTINGS_H_
#define BIN_SUPPORT_NETWORK_SETTINGS_H_

#include <string>
#include <vector>

#include "problems/problem.h"

namespace invgrad {

struct NetworkSettings {
  std::string hidden;
  std::string activation;
  std::string initialization;

  // "hidden", "activation", "initialization": as flags and as axes of a sweep.
  static const std::vector<std::string>& Names();
  // The field of that name, or null.
  std::string* Find(const std::string& name);
};

// Gives the problem another network. False with *error naming setting, value
// and what is allowed, "activation=sine is no choice; allowed: one of ..."; the
// problem is then unchanged.
bool SetNetwork(const NetworkSettings& settings,
                LearningProblem* problem,
                std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_NETWORK_SETTINGS_H_
