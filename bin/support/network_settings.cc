#include "bin/support/network_settings.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <memory>
#include <utility>

#include "invgrad/core/option_set.h"

namespace invgrad {

namespace {

constexpr std::pair<const char*, Initialization> kInitializations[] = {
    {"glorot", Initialization::kGlorotUniform},
    {"he", Initialization::kHeUniform},
    {"pytorch", Initialization::kPytorch}};

// Replaces *value by the one of that name, if a name is given. `values`: pairs
// of a name and a value.
template <typename Values, typename Value>
bool SetChoice(const char* setting,
               const std::string& name,
               const Values& values,
               Value* value,
               std::string* error) {
  if (name.empty()) return true;
  std::vector<std::string> names;
  names.reserve(std::size(values));
  for (const auto& [known, ignored] : values) names.emplace_back(known);
  std::string chosen = names[0];
  OptionSet set;
  set.Add(setting, &chosen, names, "");
  if (!set.Set(setting, name, error)) return false;
  for (const auto& [known, its_value] : values) {
    if (known == chosen) *value = its_value;
  }
  return true;
}

// "20-20-20"
bool ParseWidths(const std::string& text,
                 std::vector<int>* widths,
                 std::string* error) {
  constexpr double kMaxWidth = 1e6;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('-', begin), text.size());
    int width = 1;
    OptionSet set;
    set.Add("width", &width, {1.0, kMaxWidth}, "");
    std::string why;
    if (!set.Set("width", text.substr(begin, end - begin), &why)) {
      *error = "hidden=" + text + ": " + why +
               "; expected a width for each hidden layer, as in 20-20-20";
      return false;
    }
    widths->push_back(width);
    begin = end + 1;
  }
  return true;
}

// A network's weights are numbered by an int.
bool CheckNumWeights(const std::vector<int>& widths, std::string* error) {
  constexpr int kMaxNumWeights = std::numeric_limits<int>::max();
  if (DenseNetwork::CountWeights(widths) <= kMaxNumWeights) return true;
  *error = "the network would have more than the " +
           std::to_string(kMaxNumWeights) + " weights that are allowed";
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
    if (!ParseWidths(settings.hidden, &widths, error)) return false;
    widths.push_back(own.num_outputs());
    if (!CheckNumWeights(widths, error)) {
      *error = "hidden=" + settings.hidden + ": " + *error;
      return false;
    }
  }
  if (!SetChoice(
          "activation", settings.activation, activations, &activation, error) ||
      !SetChoice("initialization",
                 settings.initialization,
                 kInitializations,
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
