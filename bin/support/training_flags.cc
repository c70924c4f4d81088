#include "bin/support/training_flags.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <sstream>

#include "bin/support/program.h"
#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/option_set.h"
#include "problems/torch/torch_networks.h"

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
DEFINE_string(torch_script,
              "",
              "a TorchScript file, the network in place of the problem's own; "
              "its initial weights are those of the file");
DEFINE_int32(epochs, 0, "budget in epochs; 0: the problem's own if no other");
DEFINE_int64(steps, 0, "budget in steps; 0: none (100 for a point problem)");
DEFINE_double(seconds, 0.0, "budget in seconds of training; 0: none");
DEFINE_bool(cpu_time,
            false,
            "seconds of training are those of the processor, of all threads: "
            "for a fair comparison on a busy machine");
DEFINE_int32(batch_size, -1, "samples a step; 0: all; -1: the problem's own");
DEFINE_int32(
    threads,
    1,
    "threads over the samples of a batch; the results do not depend on "
    "it");
DEFINE_bool(shuffle, false, "a new order of the samples each epoch");
DEFINE_double(checkpoint_seconds,
              invgrad::TrainOptions().checkpoint_interval_in_seconds,
              "at least so long between two checkpoints of a run; 0: one after "
              "every step");

namespace invgrad {
namespace {

// Replaces *value by the one with this name, if the name is not empty. `names`:
// in the order of the enumerators.
template <typename Enum>
bool Choose(const char* setting,
            const std::string& name,
            const std::vector<std::string>& names,
            Enum* value,
            std::string* error) {
  if (name.empty()) return true;
  std::string chosen = names[0];
  OptionSet set;
  set.Add(setting, &chosen, names, "");
  if (!set.Set(setting, name, error)) return false;
  const auto it = std::find(names.begin(), names.end(), chosen);
  *value = static_cast<Enum>(it - names.begin());
  return true;
}

// The shape of a sample's input for a network of libtorch.
std::vector<std::int64_t> InputShape(const LearningProblem& problem) {
  if (!problem.input_shape.empty()) return problem.input_shape;
  return {problem.model->network().num_inputs()};
}

bool SetTorchScript(const std::string& file,
                    LearningProblem* problem,
                    std::string* error) {
  const Model& own = *problem->model;
  const TorchNetworks* const networks = LoadTorchNetworks(error);
  if (networks == nullptr) return false;
  if (own.feedback() != nullptr || own.derivatives() != nullptr) {
    *error = "torch_script: this problem needs a dense network";
    return false;
  }
  const auto network = networks->load_torch_script(
      file, InputShape(*problem), /*double_precision=*/false, error);
  if (network == nullptr) {
    *error = "torch_script=" + Printable(*error);
    return false;
  }
  if (network->num_outputs() != own.network().num_outputs()) {
    *error = fmt::format(
        "torch_script={}: it has {} outputs a sample; the problem needs {}",
        file,
        network->num_outputs(),
        own.network().num_outputs());
    return false;
  }
  problem->model = std::make_shared<Model>(own.WithNetwork(network));
  return true;
}

// Refuses the settings of dense networks. `network`: what they do not fit.
bool HasNoDenseSettings(NetworkSettings settings,
                        const std::string& network,
                        std::string* error) {
  for (const std::string& name : NetworkSettings::Names()) {
    if (name == "torch_script" || settings.Find(name)->empty()) continue;
    *error = fmt::format("{}={} is a setting of dense networks, not of a {}",
                         name,
                         Printable(*settings.Find(name)),
                         network);
    return false;
  }
  return true;
}

}  // namespace

bool ParseWidths(const std::string& text,
                 std::vector<int>* widths,
                 std::string* error) {
  if (text.empty()) return true;
  constexpr double kMaxWidth = 1e6;
  constexpr int kMaxNumWeights = std::numeric_limits<int>::max();
  std::vector<int> all = {widths->front()};
  std::istringstream parts(text + "-");
  for (std::string part; std::getline(parts, part, '-');) {
    OptionSet set;
    set.Add("width", &all.emplace_back(1), {1.0, kMaxWidth}, "");
    if (!set.Set("width", part, error)) {
      *error = fmt::format(
          "hidden={}: {}; expected a width for each hidden layer, as in "
          "20-20-20",
          Printable(text),
          *error);
      return false;
    }
  }
  all.push_back(widths->back());
  *widths = all;
  if (DenseNetwork::CountWeights(all) <= kMaxNumWeights) return true;
  *error = fmt::format(
      "hidden={}: the network would have more than the {} weights that are "
      "allowed",
      text,
      kMaxNumWeights);
  return false;
}

const std::vector<std::string>& NetworkSettings::Names() {
  static const auto& names = *new std::vector<std::string>{
      "hidden", "activation", "initialization", "torch_script"};
  return names;
}

std::string* NetworkSettings::Find(const std::string& name) {
  return name == "hidden"           ? &hidden
         : name == "activation"     ? &activation
         : name == "initialization" ? &initialization
         : name == "torch_script"   ? &torch_script
                                    : nullptr;
}

bool SetNetwork(const NetworkSettings& settings,
                LearningProblem* problem,
                std::string* error) {
  const Model& own = *problem->model;
  if (!settings.torch_script.empty()) {
    return HasNoDenseSettings(settings, "TorchScript file", error) &&
           SetTorchScript(settings.torch_script, problem, error);
  }
  if (own.dense_network() == nullptr) {
    return HasNoDenseSettings(settings, own.network().Name(), error);
  }
  std::vector<std::string> activations;
  for (const Activation activation : kActivations) {
    activations.emplace_back(ActivationName(activation));
  }
  Activation activation = own.dense_network()->hidden_activation();
  Initialization initialization = problem->initialization;
  std::vector<int> widths = own.dense_network()->widths();
  if (!ParseWidths(settings.hidden, &widths, error) ||
      !Choose(
          "activation", settings.activation, activations, &activation, error) ||
      !Choose("initialization",
              settings.initialization,
              {"glorot", "he", "pytorch"},
              &initialization,
              error)) {
    return false;
  }
  if (own.derivatives() != nullptr && own.derivatives()->order() > 1 &&
      activation == Activation::kRelu) {
    *error =
        "activation=relu has no second derivative, which this problem needs";
    return false;
  }
  problem->initialization = initialization;
  problem->model = std::make_shared<Model>(
      own.WithNetwork(DenseNetwork(widths, activation)));
  return true;
}

NetworkSettings NetworkOfFlags() {
  return {
      FLAGS_hidden, FLAGS_activation, FLAGS_initialization, FLAGS_torch_script};
}

bool CheckTrainingFlags(std::string* error) {
  return CheckFlags({{"epochs", {0.0}},
                     {"steps", {0.0}},
                     {"seconds", {0.0}},
                     {"checkpoint_seconds", {0.0}},
                     {"batch_size", {-1.0}},
                     {"threads", {1.0, 1024.0}}},
                    error);
}

void SetDefaultBudget(const LearningProblem& problem) {
  if (FLAGS_epochs == 0 && FLAGS_steps == 0 && FLAGS_seconds == 0.0) {
    FLAGS_epochs = problem.num_epochs;
  }
}

TrainOptions TrainOptionsOfFlags(int batch_size, int seed) {
  TrainOptions options;
  options.batch_size = batch_size;
  options.seed = static_cast<std::uint32_t>(seed);
  options.num_threads = FLAGS_threads;
  options.shuffle = FLAGS_shuffle;
  if (FLAGS_epochs > 0) options.max_num_epochs = FLAGS_epochs;
  if (FLAGS_steps > 0) options.max_num_steps = FLAGS_steps;
  if (FLAGS_seconds > 0.0) options.max_time_in_seconds = FLAGS_seconds;
  options.cpu_time = FLAGS_cpu_time;
  options.checkpoint_interval_in_seconds = FLAGS_checkpoint_seconds;
  return options;
}

}  // namespace invgrad
