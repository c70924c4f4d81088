#include "bin/support/learning_run_files.h"

#include <cstdint>
#include <filesystem>
#include <sstream>
#include <utility>

#include "bin/support/run_directory.h"
#include "fmt/format.h"
#include "invgrad/chain/network_file.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"
#include "invgrad/io/npy.h"

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

// What identifies the run of a result.
struct ResultDigests {
  std::string history;
  std::string weights;
  std::string identity;  // RunIdentity::ToText
};

constexpr char kDigest[] = "digest ";  // of the lines before

std::string ResultText(const LearningRunResult& result,
                       const ResultDigests& digests) {
  const std::string text = fmt::format(
      "label {}\nseed {}\nsteps {}\nseconds {:.17g}\nsaturated {}\n"
      "termination {}\nmessage {}\nhistory {}\nweights {}\n{}",
      result.label,
      result.seed,
      result.summary.num_steps,
      result.summary.train_time_in_seconds,
      result.num_saturated,
      static_cast<int>(result.summary.termination_type),
      result.summary.message,
      digests.history,
      digests.weights,
      digests.identity);
  return fmt::format("{}{}{}\n", text, kDigest, Digest().Add(text).Hex());
}

bool ParseResultText(const std::string& file,
                     LearningRunResult* result,
                     ResultDigests* digests) {
  const std::string text = file.substr(0, file.rfind(kDigest));
  if (file !=
      fmt::format("{}{}{}\n", text, kDigest, Digest().Add(text).Hex())) {
    return false;
  }
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
  in >> key >> digests->history >> key >> digests->weights >> std::ws;
  std::getline(in, digests->identity, '\0');
  return !in.bad() && key == "weights" && termination >= 0;
}

// Of the bytes of a file; empty, with *error, if it cannot be read.
std::string DigestOfFile(const std::string& path, std::string* error) {
  std::string bytes;
  return ReadFile(path, &bytes, error) ? Digest().Add(bytes).Hex() : "";
}

bool WriteResult(const std::string& directory,
                 const LearningRunResult& result,
                 const RunIdentity& identity,
                 std::string* error) {
  const ResultDigests digests{DigestOfFile(directory + "/history.csv", error),
                              DigestOfFile(directory + "/weights.npy", error),
                              identity.ToText()};
  return !digests.history.empty() && !digests.weights.empty() &&
         WriteFile(
             directory + "/result.txt", ResultText(result, digests), error);
}

}  // namespace

void ListRunFiles(const std::string& directory) {
  for (const char* name : {"/history.csv",
                           "/weights.npy",
                           "/network.txt",
                           "/neurons.csv",
                           "/sample_path.csv",
                           "/result.txt",
                           "/checkpoint"}) {
    RunFile(directory + name);
  }
}

bool WriteRunFiles(const std::string& directory,
                   const DenseNetwork& network,
                   const LearningRunResult& result,
                   const RunIdentity& identity,
                   const std::vector<NeuronStatistics>& final_neurons,
                   std::string* error) {
  const bool was_interrupted =
      result.summary.termination_type == ceres::USER_SUCCESS;
  return WriteHistory(directory + "/history.csv", result.history, error) &&
         WriteNpy(directory + "/weights.npy", result.weights, error) &&
         WriteNetwork(
             directory + "/network.txt", network, result.weights, error) &&
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
  constexpr std::uint64_t kMaxSize = 1 << 16;
  if (!ReadFile(file, &text, error, kMaxSize)) return false;
  ResultDigests digests;
  if (!ParseResultText(text, result, &digests)) {
    *error = file + ": not a result of a run, or damaged";
    return false;
  }
  TrainOptions train_options = options.train;
  train_options.inverse = problem.inverse;
  const std::string difference =
      IdentityOfRun(
          *problem.model, problem.train, problem.test, method, train_options)
          .Difference(digests.identity);
  if (!difference.empty()) {
    *error = file + ": it is of another run: " + difference;
    return false;
  }
  for (const auto& [name, digest] :
       {std::pair("history.csv", digests.history),
        std::pair("weights.npy", digests.weights)}) {
    const std::string path = directory + '/' + name;
    const std::string found = DigestOfFile(path, error);
    if (found.empty()) return false;
    if (found != digest) {
      *error = path + ": damaged, or not of the run of result.txt";
      return false;
    }
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
