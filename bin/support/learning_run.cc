#include "bin/support/learning_run.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <sstream>
#include <utility>

#include "bin/support/program.h"
#include "fmt/format.h"
#include "invgrad/chain/network_file.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/io/npy.h"
#include "invgrad/io/numpy_random.h"
#include "problems/problems.h"

namespace invgrad {
namespace {

// Networks with more hidden neurons keep only their final statistics.
constexpr int kMaxTrackedNeurons = 64;

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

std::string ResultText(const LearningRunResult& result) {
  return fmt::format(
      "label {}\nseed {}\nsteps {}\nseconds {:.17g}\nsaturated {}\n"
      "termination {}\nmessage {}\n",
      result.label,
      result.seed,
      result.summary.num_steps,
      result.summary.train_time_in_seconds,
      result.num_saturated,
      static_cast<int>(result.summary.termination_type),
      result.summary.message);
}

bool ParseResultText(const std::string& text, LearningRunResult* result) {
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
  return !in.fail() && key == "message" && termination >= 0;
}

bool WriteRun(const std::string& directory,
              const DenseNetwork& network,
              const LearningRunResult& result,
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
         (was_interrupted ||
          WriteFile(directory + "/result.txt", ResultText(result), error));
}

// Computed on the test data, or on the train data if there are none, in pieces
// whose activations stay in the cache.
double EvaluateMetric(const LearningProblem& problem,
                      const Eigen::VectorXd& weights) {
  constexpr int kPieceSize = 512;
  const DataSet& data =
      problem.test.num_samples() > 0 ? problem.test : problem.train;
  const Model& model = *problem.model;
  Eigen::MatrixXd x(model.simulator().num_inputs(), data.num_samples());
  DenseNetwork::Activations activations;
  std::string error;
  for (int first = 0; first < data.num_samples(); first += kPieceSize) {
    const int count = std::min(kPieceSize, data.num_samples() - first);
    if (!model.Forward(
            weights, data.Range(first, count), false, &activations, &error)) {
      return HistoryRow::kNone;
    }
    x.middleCols(first, count) = model.SimulatorInputs(activations);
  }
  return problem.metric->evaluate(x, data);
}

}  // namespace

bool CreateLearningProblem(const std::string& specification,
                           LearningProblem* problem,
                           std::string* error) {
  PhysicsProblem created;
  if (!CreateProblem(specification, nullptr, &created, error)) return false;
  if (!created.learning.has_value()) {
    *error = specification +
             " has no network to train; allowed are learning problems "
             "(compare and trajectories show point problems)";
    return false;
  }
  *problem = *std::move(created.learning);
  return true;
}

int NumHiddenNeurons(const DenseNetwork& network) {
  int sum = 0;
  for (int layer = 1; layer < network.num_layers(); ++layer) {
    sum += network.widths()[layer];
  }
  return sum;
}

Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed) {
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  return problem.model->network().InitialWeights(problem.initialization,
                                                 &random);
}

int BatchSize(const LearningProblem& problem, int flag_batch_size) {
  return Phase().BatchSize(
      flag_batch_size >= 0 ? flag_batch_size : problem.batch_size,
      problem.train.num_samples());
}

bool CheckBatches(const LearningProblem& problem,
                  const std::vector<Method>& methods,
                  int flag_batch_size,
                  std::string* error) {
  const int num_samples = problem.train.num_samples();
  const auto fits = [&](const std::string& what, int batch_size) {
    if (batch_size <= num_samples) return true;
    *error = fmt::format(
        "{}batch_size={} is out of range; allowed: 1 to the {} training "
        "samples, or 0 for all",
        what,
        batch_size,
        num_samples);
    return false;
  };
  if (!fits("--", BatchSize(problem, flag_batch_size))) return false;
  for (const Method& method : methods) {
    for (const Phase& phase : method.phases) {
      if (!fits("--rules: " + method.label + ": ", phase.batch_size)) {
        return false;
      }
    }
  }
  return problem.train.IsFinite(error) && problem.test.IsFinite(error);
}

void WarnOfLeftOutSamples(const Method& method,
                          int batch_size,
                          int num_samples,
                          std::set<std::string>* warned) {
  for (const Phase& phase : method.phases) {
    const int size = phase.BatchSize(batch_size, num_samples);
    if (num_samples % size == 0) continue;
    int below = size, above = size;
    while (num_samples % below != 0) --below;
    while (num_samples % above != 0) ++above;
    const std::string warning = fmt::format(
        "batch_size={}: {} of {} samples are left out of every "
        "epoch; divisors near: {}, {}",
        size,
        num_samples % size,
        num_samples,
        below,
        above);
    if (warned->insert(warning).second) Warn(warning);
  }
}

double LearningRunResult::BestTrainLoss() const {
  double best = HistoryRow::kNone;
  for (const HistoryRow& row : history) best = std::fmin(best, row.train_loss);
  return best;
}

double LearningRunResult::SecondsToLevel(double level) const {
  for (const HistoryRow& row : history) {
    if (row.train_loss <= level) return row.seconds;
  }
  return HistoryRow::kNone;
}

double LearningRunResult::MillisecondsPerStep() const {
  return summary.num_steps > 0 ? 1e3 * summary.train_time_in_seconds /
                                     static_cast<double>(summary.num_steps)
                               : HistoryRow::kNone;
}

bool RunLearning(const LearningProblem& problem,
                 const Method& method,
                 int seed,
                 const Eigen::VectorXd& initial_weights,
                 const LearningRunOptions& options,
                 LearningRunResult* result,
                 std::string* error) {
  std::error_code failure;
  std::filesystem::create_directories(options.directory, failure);
  if (failure) {
    *error = options.directory + ": " + failure.message();
    return false;
  }
  // Files of a shorter run that is resumed, not results of this run.
  for (const char* name : {"/result.txt", "/sample_path.csv"}) {
    std::filesystem::remove(options.directory + name, failure);
  }
  const DenseNetwork& network = problem.model->network();
  std::vector<std::vector<NeuronStatistics>> neurons;
  std::vector<Eigen::VectorXd> sample_path;
  const bool tracks_neurons = NumHiddenNeurons(network) <= kMaxTrackedNeurons;
  const int tracked = options.tracked_sample;

  TrainOptions train_options = options.train;
  train_options.initial_weights = initial_weights;
  train_options.inverse = problem.inverse;
  train_options.checkpoint_path = options.directory + "/checkpoint";
  if (problem.metric.has_value()) {
    train_options.metric = [&](const Eigen::VectorXd& weights) {
      return EvaluateMetric(problem, weights);
    };
  }
  train_options.on_evaluation = [&](const Eigen::VectorXd& weights,
                                    const History& /*history*/) {
    if (tracks_neurons) {
      neurons.push_back(
          ComputeNeuronStatistics(network, weights, problem.train));
    }
    if (tracked >= 0) {
      Eigen::MatrixXd y;
      std::string ignored;
      if (!problem.model->Predict(
              weights, problem.train.Range(tracked, 1), &y, &ignored)) {
        y.setConstant(HistoryRow::kNone);
      }
      sample_path.emplace_back(y.col(0));
    }
  };
  TrainingRun run(
      *problem.model, {problem.train, problem.test}, method, train_options);
  while (run.Step()) {
    if (options.on_step && !options.on_step(run)) run.Stop();
  }
  *error = run.error();
  if (!error->empty()) return false;
  *result = LearningRunResult();
  static_cast<TrainResult&>(*result) = run.result();
  result->label = method.label;
  result->seed = seed;
  const std::vector<NeuronStatistics> final_neurons =
      ComputeNeuronStatistics(network, result->weights, problem.train);
  result->num_saturated = CountSaturated(final_neurons);
  // Neurons and y of evaluations before a checkpoint, in another process, are
  // unknown.
  const size_t num_evaluations = result->history.size();
  if (neurons.size() == num_evaluations) result->neurons = std::move(neurons);
  if (sample_path.size() == num_evaluations) {
    result->sample_path = std::move(sample_path);
  }
  if (!WriteRun(options.directory, network, *result, final_neurons, error)) {
    return false;
  }
  const ceres::TerminationType type = result->summary.termination_type;
  if (type != ceres::USER_SUCCESS && type != ceres::NO_CONVERGENCE) {
    std::filesystem::remove(train_options.checkpoint_path, failure);
  }
  return true;
}

bool LoadCompleteRun(const std::string& directory,
                     const LearningProblem& problem,
                     const TrainOptions& options,
                     LearningRunResult* result,
                     std::string* error) {
  error->clear();
  *result = LearningRunResult();
  const std::string file = directory + "/result.txt";
  std::string text;
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return false;
  constexpr std::uint64_t kMaxSize = 1 << 16;
  if (!ReadFile(file, &text, error, kMaxSize)) return false;
  if (!ParseResultText(text, result)) {
    *error = file + ": not a result of a run";
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
      result->last().epoch < options.max_num_epochs * (1.0 - 1e-12) &&
      summary.num_steps < options.max_num_steps &&
      summary.train_time_in_seconds < options.max_time_in_seconds;
  return ReadNpy(directory + "/weights.npy",
                 problem.model->num_weights(),
                 &result->weights,
                 error) &&
         !has_budget_left;
}

void AddTimes(const LearningRunResult* run, Table* table) {
  const LearningRunResult none;
  const LearningRunResult& times = run != nullptr ? *run : none;
  const auto add = [&](const std::string& title, const std::string& cell) {
    table->Add(title, run != nullptr ? cell : "-");
  };
  add("steps", std::to_string(times.summary.num_steps));
  add("s", FormatNumber(times.summary.train_time_in_seconds));
  add("ms/step", NumberOrDash(times.MillisecondsPerStep()));
}

}  // namespace invgrad
