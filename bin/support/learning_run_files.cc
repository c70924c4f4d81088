#include "bin/support/learning_run_files.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <sstream>

#include "bin/support/run_directory.h"
#include "fmt/ranges.h"
#include "invgrad/dense_network.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"

namespace invgrad {
namespace {

// One line a neuron and evaluation; the last evaluation only, if no other was
// recorded.
std::string NeuronsCsv(const LearningRunResult& result,
                       const std::vector<NeuronStatistics>& final_neurons) {
  std::string csv = "step,layer,neuron,mean,deviation,flat_share\n";
  const auto add = [&csv](long step, const auto& neurons) {
    for (const NeuronStatistics& neuron : neurons) {
      csv += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n",
                         step,
                         neuron.layer,
                         neuron.neuron,
                         neuron.mean,
                         neuron.deviation,
                         neuron.flat_share);
    }
  };
  if (result.neurons.empty()) add(result.summary.num_steps, final_neurons);
  for (size_t i = 0; i < result.neurons.size(); ++i) {
    add(result.history[i].step, result.neurons[i]);
  }
  return csv;
}

std::string SamplePathCsv(const LearningRunResult& result) {
  std::string csv = "step";
  for (Eigen::Index j = 0; j < result.sample_path[0].size(); ++j) {
    csv += fmt::format(",y{}", j);
  }
  for (size_t i = 0; i < result.sample_path.size(); ++i) {
    csv += fmt::format("\n{},{:.17g}",
                       result.history[i].step,
                       fmt::join(result.sample_path[i], ","));
  }
  return csv + '\n';
}

constexpr char kDigest[] = "digest ";

// The last line of result.txt: the digest of its other lines, of the history
// and of the weights.
bool MakeDigestLine(const std::string& directory,
                    const std::string& text,
                    std::string* line,
                    std::string* error) {
  std::string history, weights;
  if (!ReadFile(directory + "/history.csv", &history, error) ||
      !ReadFile(directory + "/weights.npy", &weights, error)) {
    return false;
  }
  *line = kDigest + Digest().Add(text).Add(history).Add(weights).Hex() + '\n';
  return true;
}

bool WriteResult(const std::string& directory,
                 const LearningRunResult& result,
                 const RunIdentity& identity,
                 std::string* error) {
  std::string message = result.summary.message;
  std::replace(message.begin(), message.end(), '\n', ' ');
  const std::string text = fmt::format(
      "label {}\nseed {}\nsteps {}\nseconds {:.17g}\nsaturated {}\n"
      "termination {}\nmessage {}\n{}",
      result.label,
      result.seed,
      result.summary.num_steps,
      result.summary.train_time_in_seconds,
      result.num_saturated,
      static_cast<int>(result.summary.termination_type),
      message,
      identity.text());
  std::string digest;
  return MakeDigestLine(directory, text, &digest, error) &&
         WriteFile(directory + "/result.txt", text + digest, error);
}

// Parses result.txt but for its last line.
bool ParseResultText(const std::string& text,
                     LearningRunResult* result,
                     std::string* identity) {
  std::istringstream in(text);
  std::string key;
  int termination = -1;
  in >> key >> std::ws;
  std::getline(in, result->label);
  in >> key >> result->seed >> key >> result->summary.num_steps >> key >>
      result->summary.train_time_in_seconds >> key >> result->num_saturated >>
      key >> termination >> key;
  in.ignore();  // the space
  std::getline(in, result->summary.message);
  result->summary.termination_type =
      static_cast<ceres::TerminationType>(termination);
  const bool is_good = !in.fail() && key == "message" && termination >= 0;
  std::getline(in, *identity, '\0');
  return is_good;
}

}  // namespace

bool ListRunFiles(const std::string& directory, std::string* error) {
  for (const char* name : {"/history.csv",
                           "/weights.npy",
                           "/network.txt",
                           "/neurons.csv",
                           "/sample_path.csv",
                           "/result.txt",
                           "/checkpoint"}) {
    if (!ListRunFile(directory + name, error)) return false;
  }
  return true;
}

bool WriteRunFiles(const std::string& directory,
                   const Network& network,
                   const LearningRunResult& result,
                   const RunIdentity& identity,
                   const std::vector<NeuronStatistics>& final_neurons,
                   std::string* error) {
  const auto* dense = dynamic_cast<const DenseNetwork*>(&network);
  const bool was_interrupted =
      result.summary.termination_type == ceres::USER_SUCCESS;
  return WriteHistory(directory + "/history.csv", result.history, error) &&
         WriteNpy(directory + "/weights.npy", result.weights, error) &&
         (dense == nullptr ||
          WriteNetwork(
              directory + "/network.txt", *dense, result.weights, error)) &&
         WriteFile(directory + "/neurons.csv",
                   NeuronsCsv(result, final_neurons),
                   error) &&
         (result.sample_path.empty() ||
          WriteFile(
              directory + "/sample_path.csv", SamplePathCsv(result), error)) &&
         (was_interrupted || WriteResult(directory, result, identity, error));
}

bool LoadCompleteRun(const LearningProblem& problem,
                     const Method& method,
                     const LearningRunOptions& options,
                     LearningRunResult* result,
                     std::string* error) {
  error->clear();
  *result = LearningRunResult();
  const std::string& directory = options.directory;
  const std::string file = directory + "/result.txt";
  std::string text;
  std::error_code failure;
  if (!std::filesystem::exists(file, failure)) return false;
  std::string digest, identity;
  constexpr std::uint64_t kMaxSize = 1 << 16;
  if (!ReadFile(file, &text, error, kMaxSize)) return false;
  const std::string lines = text.substr(0, text.rfind(kDigest));
  if (!ParseResultText(lines, result, &identity)) {
    *error = file + ": not a result of a run";
    return false;
  }
  TrainOptions train_options = options.train;
  train_options.inverse = problem.inverse;
  const std::string difference = IdentityOfRun(*problem.model,
                                               problem.train,
                                               problem.test,
                                               problem.source.get(),
                                               method,
                                               train_options)
                                     .Difference(identity);
  if (!difference.empty()) {
    *error = file + ": it is of another run: " + difference;
    return false;
  }
  if (!MakeDigestLine(directory, lines, &digest, error)) return false;
  if (text != lines + digest) {
    *error =
        file + ": it, history.csv or weights.npy is damaged or of another run";
    return false;
  }
  if (!ReadHistory(directory + "/history.csv", &result->history, error)) {
    return false;
  }
  if (result->history.empty()) {
    *error = directory + "/history.csv: has no rows";
    return false;
  }
  const TrainSummary& summary = result->summary;
  const bool has_budget_left =
      summary.termination_type == ceres::NO_CONVERGENCE &&
      result->last().epoch < options.train.max_num_epochs * (1.0 - 1e-12) &&
      summary.num_steps < options.train.max_num_steps &&
      summary.train_time_in_seconds < options.train.max_time_in_seconds;
  return ReadNpy(directory + "/weights.npy",
                 problem.model->num_weights(),
                 &result->weights,
                 error) &&
         !has_budget_left;
}

}  // namespace invgrad
