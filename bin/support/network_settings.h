// Settings that replace the problem's network: widths and activation of the
// hidden layers, and initialization of the weights.
//
//   hidden=20-20-20        a width a hidden layer
//   activation=relu        linear, tanh, relu, sigmoid, gelu; see activation.h
//   initialization=he      glorot, he, pytorch; see dense_network.h
//
// Inputs, outputs, simulator, loss, data and feedback do not change; empty text
// keeps the problem's setting.
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
  // The field with this name, or null.
  std::string* Find(const std::string& name);
};

// Replaces the problem's network. Returns false with *error "activation=sine is
// no choice; allowed: one of ..." for a setting that is not allowed; the
// problem is then unchanged.
bool SetNetwork(const NetworkSettings& settings,
                LearningProblem* problem,
                std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_NETWORK_SETTINGS_H_
