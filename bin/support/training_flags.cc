#include "bin/support/training_flags.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <sstream>
#include <utility>

#include "bin/support/flags.h"
#include "bin/support/program.h"
#include "fmt/core.h"
#include "invgrad/compare/compare.h"
#include "invgrad/core/specification.h"
#include "invgrad/option_set.h"

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

TorchScriptLoader& LoaderOfTorchScript() {
  static auto& loader = *new TorchScriptLoader;
  return loader;
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
  if (LoaderOfTorchScript() == nullptr) {
    *error = "torch_script: this program has no loader (SetTorchScriptLoader)";
    return false;
  }
  if (own.feedback() != nullptr || own.derivatives() != nullptr) {
    *error = "torch_script: this problem needs a dense network";
    return false;
  }
  const auto network = LoaderOfTorchScript()(
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

void SetTorchScriptLoader(TorchScriptLoader loader) {
  LoaderOfTorchScript() = std::move(loader);
}

void TrainingFlags::AddShared() {
  AddFlag("hidden",
          &network.hidden,
          "widths of the network's hidden layers, as 20-20-20; empty: the "
          "problem's own");
  AddFlag("cpu_time",
          &cpu_time,
          "seconds of training are those of the processor, of all threads: "
          "for a fair comparison on a busy machine");
  AddFlag("threads",
          &threads,
          "threads over the samples of a batch; the results do not depend on "
          "it");
}

void TrainingFlags::Add() {
  AddShared();
  AddFlag("activation",
          &network.activation,
          "of the hidden layers: linear, tanh, relu, sigmoid, gelu; empty: "
          "the problem's own");
  AddFlag("initialization",
          &network.initialization,
          "of the weights: glorot, he, pytorch; empty: the problem's own");
  AddFlag("torch_script",
          &network.torch_script,
          "a TorchScript file, the network in place of the problem's own; "
          "its initial weights are those of the file");
  AddFlag(
      "epochs", &epochs, "budget in epochs; 0: the problem's own if no other");
  AddFlag("steps",
          &steps,
          "budget in steps; 0: none (of a problem without a network: its own)");
  AddFlag("seconds", &seconds, "budget in seconds of training; 0: none");
  AddFlag("batch_size",
          &batch_size,
          "samples a step; 0: all; -1: the problem's own");
  AddFlag("shuffle", &shuffle, "a new order of the samples each epoch");
  AddFlag("checkpoint_seconds",
          &checkpoint_seconds,
          "at least so long between two checkpoints of a run; 0: one after "
          "every step");
}

bool TrainingFlags::Check(std::string* error) const {
  return CheckFlags({{"epochs", {0.0}},
                     {"steps", {0.0}},
                     {"seconds", {0.0}},
                     {"checkpoint_seconds", {0.0}},
                     {"batch_size", {-1.0}},
                     {"threads", {1.0, 1024.0}}},
                    error);
}

void TrainingFlags::SetDefaultBudget(const LearningProblem& problem) {
  if (epochs == 0 && steps == 0 && seconds == 0.0) epochs = problem.num_epochs;
}

void TrainingFlags::SetBudget(MinimizerOptions* options) const {
  if (steps > 0) options->max_num_iterations = static_cast<int>(steps);
  if (seconds > 0.0) options->max_time_in_seconds = seconds;
}

std::string TrainingFlags::BudgetText() const {
  std::string text;
  const auto add = [&text](const std::string& part) {
    text += (text.empty() ? "" : ", or ") + part;
  };
  if (seconds > 0.0) {
    add(fmt::format(
        "{:g} s of {}", seconds, cpu_time ? "processor time" : "training"));
  }
  if (steps > 0) add(fmt::format("{} steps", steps));
  if (epochs > 0) add(fmt::format("{} epochs", epochs));
  return text;
}

TrainOptions TrainingFlags::Options(int batch_size_of_run, int seed) const {
  TrainOptions options;
  options.batch_size = batch_size_of_run;
  options.seed = static_cast<std::uint32_t>(seed);
  options.num_threads = threads;
  options.shuffle = shuffle;
  if (epochs > 0) options.max_num_epochs = epochs;
  if (steps > 0) options.max_num_steps = steps;
  if (seconds > 0.0) options.max_time_in_seconds = seconds;
  options.cpu_time = cpu_time;
  options.checkpoint_interval_in_seconds = checkpoint_seconds;
  return options;
}

bool CheckNoTraining(bool takes_threads, std::string* error) {
  std::vector<std::string> names = {"hidden",
                                    "activation",
                                    "initialization",
                                    "torch_script",
                                    "epochs",
                                    "batch_size",
                                    "shuffle",
                                    "cpu_time",
                                    "checkpoint_seconds",
                                    "target_loss",
                                    "patience",
                                    "track_sample",
                                    "init_weights"};
  if (!takes_threads) names.emplace_back("threads");
  constexpr int kMaxSteps = std::numeric_limits<int>::max();
  return CheckNotGiven(names, "needs a problem with a network", error) &&
         CheckFlags({{"steps", {0.0, kMaxSteps}}}, error);
}

}  // namespace invgrad
