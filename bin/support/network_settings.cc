#include "bin/support/network_settings.h"

#include <limits>
#include <memory>
#include <sstream>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/option_set.h"

namespace invgrad {

namespace {

const std::vector<std::pair<std::string, Initialization>>& Initializations() {
  static const auto& all =
      *new std::vector<std::pair<std::string, Initialization>>{
          {"glorot", Initialization::kGlorotUniform},
          {"he", Initialization::kHeUniform},
          {"pytorch", Initialization::kPytorch}};
  return all;
}

// Replaces *value by the value with this name, if the name is not empty.
template <typename Value>
bool SetChoice(const char* setting,
               const std::string& name,
               const std::vector<std::pair<std::string, Value>>& choices,
               Value* value,
               std::string* error) {
  if (name.empty()) return true;
  std::vector<std::string> names;
  names.reserve(choices.size());
  for (const auto& choice : choices) names.push_back(choice.first);
  std::string chosen = names[0];
  OptionSet set;
  set.Add(setting, &chosen, names, "");
  if (!set.Set(setting, name, error)) return false;
  for (const auto& [known, its_value] : choices) {
    if (known == chosen) *value = its_value;
  }
  return true;
}

// "20-20-20". A network's weights are numbered by an int.
bool ParseWidths(const std::string& text,
                 int num_outputs,
                 std::vector<int>* widths,
                 std::string* error) {
  constexpr double kMaxWidth = 1e6;
  std::istringstream parts(text + "-");
  for (std::string part; std::getline(parts, part, '-');) {
    int width = 1;
    OptionSet set;
    set.Add("width", &width, {1.0, kMaxWidth}, "");
    if (!set.Set("width", part, error)) {
      *error = fmt::format(
          "hidden={}: {}; expected a width for each hidden layer, as in "
          "20-20-20",
          text,
          *error);
      return false;
    }
    widths->push_back(width);
  }
  widths->push_back(num_outputs);
  constexpr int kMaxNumWeights = std::numeric_limits<int>::max();
  if (DenseNetwork::CountWeights(*widths) <= kMaxNumWeights) return true;
  *error = fmt::format(
      "hidden={}: the network would have more than the {} weights that are "
      "allowed",
      text,
      kMaxNumWeights);
  return false;
}

}  // namespace

const std::vector<std::string>& NetworkSettings::Names() {
  static const auto& names =
      *new std::vector<std::string>{"hidden", "activation", "initialization"};
  return names;
}

std::string* NetworkSettings::Find(const std::string& name) {
  if (name == "hidden") return &hidden;
  if (name == "activation") return &activation;
  if (name == "initialization") return &initialization;
  return nullptr;
}

bool SetNetwork(const NetworkSettings& settings,
                LearningProblem* problem,
                std::string* error) {
  const DenseNetwork& own = problem->model->network();
  std::vector<std::pair<std::string, Activation>> activations;
  for (const Activation activation : kActivations) {
    activations.emplace_back(ActivationName(activation), activation);
  }
  Activation activation = own.hidden_activation();
  Initialization initialization = problem->initialization;
  std::vector<int> widths = own.widths();
  if (!settings.hidden.empty()) {
    widths = {own.num_inputs()};
    if (!ParseWidths(settings.hidden, own.num_outputs(), &widths, error)) {
      return false;
    }
  }
  if (!SetChoice(
          "activation", settings.activation, activations, &activation, error) ||
      !SetChoice("initialization",
                 settings.initialization,
                 Initializations(),
                 &initialization,
                 error)) {
    return false;
  }
  if (problem->model->network_output() == NetworkOutput::kTwoJet &&
      activation == Activation::kRelu) {
    *error = "activation=relu has no Laplacian, which this problem needs";
    return false;
  }
  problem->initialization = initialization;
  problem->model = std::make_shared<Model>(
      problem->model->WithNetwork(DenseNetwork(widths, activation)));
  return true;
}

}  // namespace invgrad
