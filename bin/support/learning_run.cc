#include "bin/support/learning_run.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "invgrad/chain/network_file.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/npy.h"

namespace invgrad {

namespace {

// Networks with more hidden neurons keep only their final statistics.
constexpr int kMaxTrackedNeurons = 64;

int NumHiddenNeurons(const DenseNetwork& network) {
  int sum = 0;
  for (int layer = 1; layer < network.num_layers(); ++layer) {
    sum += network.widths()[layer];
  }
  return sum;
}

std::ostringstream CsvStream() {
  std::ostringstream csv;
  csv.precision(std::numeric_limits<double>::max_digits10);
  return csv;
}

// One line a neuron and evaluation; the last evaluation only, if no other was
// recorded.
std::string NeuronsCsv(
    const std::vector<long>& steps,
    const std::vector<std::vector<NeuronStatistics>>& neurons) {
  std::ostringstream csv = CsvStream();
  csv << "step,layer,neuron,mean,deviation,flat_share\n";
  for (size_t i = 0; i < neurons.size(); ++i) {
    for (const NeuronStatistics& neuron : neurons[i]) {
      csv << steps[i] << ',' << neuron.layer << ',' << neuron.neuron << ','
          << neuron.mean << ',' << neuron.deviation << ',' << neuron.flat_share
          << '\n';
    }
  }
  return csv.str();
}

std::string SamplePathCsv(const History& history,
                          const std::vector<Eigen::VectorXd>& path) {
  std::ostringstream csv = CsvStream();
  csv << "step";
  for (Eigen::Index j = 0; j < path.front().size(); ++j) csv << ",y" << j;
  csv << '\n';
  for (size_t i = 0; i < path.size(); ++i) {
    csv << history[i].step;
    for (const double y : path[i]) csv << ',' << y;
    csv << '\n';
  }
  return csv.str();
}

std::string ResultText(const LearningRunResult& result) {
  std::ostringstream text;
  text.precision(std::numeric_limits<double>::max_digits10);
  text << "label " << result.label << "\nseed " << result.seed << "\nsteps "
       << result.summary.num_steps << "\nseconds "
       << result.summary.train_time_in_seconds << "\nsaturated "
       << result.num_saturated << "\ntermination "
       << result.summary.termination_type << "\nmessage "
       << result.summary.message << "\n";
  return text.str();
}

bool ParseResultText(const std::string& text, LearningRunResult* result) {
  std::istringstream lines(text);
  int termination = -1;
  int num_fields = 0;
  for (std::string line; std::getline(lines, line);) {
    const size_t space = line.find(' ');
    if (space == std::string::npos) return false;
    const std::string key = line.substr(0, space);
    std::istringstream value(line.substr(space + 1));
    ++num_fields;
    if (key == "label") {
      result->label = value.str();
    } else if (key == "seed") {
      value >> result->seed;
    } else if (key == "steps") {
      value >> result->summary.num_steps;
    } else if (key == "seconds") {
      value >> result->summary.train_time_in_seconds;
    } else if (key == "saturated") {
      value >> result->num_saturated;
    } else if (key == "termination") {
      value >> termination;
    } else if (key == "message") {
      result->summary.message = value.str();
    } else {
      return false;
    }
    if (value.fail()) return false;
  }
  result->summary.termination_type =
      static_cast<ceres::TerminationType>(termination);
  return num_fields == 7 && termination >= 0;
}

bool WriteRun(const std::string& directory,
              const DenseNetwork& network,
              const LearningRunResult& result,
              const std::vector<NeuronStatistics>& final_neurons,
              std::string* error) {
  std::vector<long> steps;
  std::vector<std::vector<NeuronStatistics>> neurons = result.neurons;
  for (const HistoryRow& row : result.history) steps.push_back(row.step);
  if (neurons.empty()) {
    neurons.push_back(final_neurons);
    steps = {result.summary.num_steps};
  }
  return WriteHistory(directory + "/history.csv", result.history, error) &&
         WriteNpy(directory + "/weights.npy", result.weights, error) &&
         WriteNetwork(
             directory + "/network.txt", network, result.weights, error) &&
         WriteFile(
             directory + "/neurons.csv", NeuronsCsv(steps, neurons), error) &&
         (result.sample_path.empty() ||
          WriteFile(directory + "/sample_path.csv",
                    SamplePathCsv(result.history, result.sample_path),
                    error)) &&
         (result.was_interrupted() ||
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

bool HasBudgetLeft(const LearningRunResult& result,
                   const TrainOptions& options) {
  return result.has_used_its_budget() &&
         result.last().epoch < options.max_num_epochs * (1.0 - 1e-12) &&
         result.summary.num_steps < options.max_num_steps &&
         result.summary.train_time_in_seconds < options.max_time_in_seconds;
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
  *result = LearningRunResult();
  result->label = method.label;
  result->seed = seed;
  result->num_hidden_neurons = NumHiddenNeurons(network);
  const bool tracks_neurons = result->num_hidden_neurons <= kMaxTrackedNeurons;
  const DataSet tracked = options.tracked_sample < 0
                              ? problem.train.Range(0, 0)
                              : problem.train.Range(options.tracked_sample, 1);

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
                                    const History& history) {
    if (tracks_neurons) {
      result->neurons.push_back(
          ComputeNeuronStatistics(network, weights, problem.train));
    }
    if (tracked.num_samples() > 0) {
      Eigen::MatrixXd y;
      std::string ignored;
      result->sample_path.push_back(
          problem.model->Predict(weights, tracked, &y, &ignored)
              ? Eigen::VectorXd(y.col(0))
              : Eigen::VectorXd::Constant(problem.model->loss().size(),
                                          HistoryRow::kNone));
    }
    if (options.train.on_evaluation) {
      options.train.on_evaluation(weights, history);
    }
  };
  TrainingRun run(
      *problem.model, {problem.train, problem.test}, method, train_options);
  while (run.Step()) {
    if (options.on_step && !options.on_step(run)) run.Stop();
  }
  *error = run.error();
  if (!error->empty()) return false;
  result->weights = run.weights();
  result->history = run.history();
  result->summary = run.summary();
  const std::vector<NeuronStatistics> final_neurons =
      ComputeNeuronStatistics(network, result->weights, problem.train);
  result->num_saturated = CountSaturated(final_neurons);
  // Neurons and y of evaluations before a checkpoint, in another process, are
  // unknown.
  if (result->neurons.size() != result->history.size()) result->neurons.clear();
  if (result->sample_path.size() != result->history.size()) {
    result->sample_path.clear();
  }
  if (!WriteRun(options.directory, network, *result, final_neurons, error)) {
    return false;
  }
  if (!result->was_interrupted() && !result->has_used_its_budget()) {
    std::filesystem::remove(train_options.checkpoint_path, failure);
  }
  return true;
}

bool LoadLearningRun(const std::string& directory,
                     const LearningProblem& problem,
                     LearningRunResult* result,
                     std::string* error) {
  error->clear();
  std::ifstream file(directory + "/result.txt");
  if (!file) return false;
  std::ostringstream text;
  text << file.rdbuf();
  *result = LearningRunResult();
  if (!ParseResultText(text.str(), result)) {
    *error = directory + "/result.txt: not a result of compare";
    return false;
  }
  result->num_hidden_neurons = NumHiddenNeurons(problem.model->network());
  if (!ReadHistory(directory + "/history.csv", &result->history, error)) {
    return false;
  }
  if (result->history.empty()) {
    *error = directory + "/history.csv: has no rows";
    return false;
  }
  return ReadNpy(directory + "/weights.npy",
                 problem.model->num_weights(),
                 &result->weights,
                 error);
}

}  // namespace invgrad
