#include "bin/support/learning_run.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "bin/support/learning_run_files.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "fmt/core.h"
#include "invgrad/compare/compare.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/io/format.h"
#include "invgrad/method.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

// Networks with more hidden neurons keep only their final statistics.
constexpr int kMaxTrackedNeurons = 64;

// Computed on the test data, or on the train data if there are none, in pieces
// whose activations stay in the cache.
double EvaluateMetric(const LearningProblem& problem,
                      const Eigen::VectorXd& weights) {
  constexpr int kPieceSize = 512;
  const DataSet& data =
      problem.test.num_samples() > 0 ? problem.test : problem.train;
  const Model& model = *problem.model;
  Eigen::MatrixXd x(model.simulator().num_inputs(), data.num_samples());
  const auto pass = model.network().NewPass();
  std::string error;
  // The samples of other networks may depend on each other.
  const int piece_size =
      model.dense_network() != nullptr ? kPieceSize : data.num_samples();
  for (int first = 0; first < data.num_samples(); first += piece_size) {
    const int count = std::min(piece_size, data.num_samples() - first);
    if (!model.Forward(weights,
                       data.Range(first, count),
                       Network::Derivatives::kNone,
                       pass.get(),
                       &error)) {
      return HistoryRow::kNone;
    }
    x.middleCols(first, count) = model.SimulatorInputs(*pass);
  }
  return problem.metric->evaluate(x, data);
}

// What a run keeps of its evaluations.
struct Evaluations {
  bool tracks_neurons = false;
  int tracked_sample = -1;
  std::vector<std::vector<NeuronStatistics>> neurons;
  std::vector<Eigen::VectorXd> sample_path;

  void Add(const LearningProblem& problem, const Eigen::VectorXd& weights) {
    if (tracks_neurons) {
      neurons.push_back(ComputeNeuronStatistics(
          problem.model->network(), weights, problem.train));
    }
    if (tracked_sample < 0) return;
    Eigen::MatrixXd y;
    std::string ignored;
    if (!problem.model->Predict(
            weights, problem.train.Range(tracked_sample, 1), &y, &ignored)) {
      y.setConstant(HistoryRow::kNone);
    }
    sample_path.emplace_back(y.col(0));
  }

  // Neurons and y of evaluations before a checkpoint, in another process, are
  // unknown.
  void MoveTo(LearningRunResult* result) {
    const size_t num_evaluations = result->history.size();
    if (neurons.size() == num_evaluations) result->neurons = std::move(neurons);
    if (sample_path.size() == num_evaluations) {
      result->sample_path = std::move(sample_path);
    }
  }
};

}  // namespace

bool CreateLearningProblem(const std::string& specification,
                           LearningProblem* problem,
                           std::string* error) {
  PhysicsProblem created;
  if (!CreateProblem(specification, nullptr, &created, error)) return false;
  if (!created.learning.has_value()) {
    *error = specification +
             " has no network to train; allowed are learning problems "
             "(compare shows the others)";
    return false;
  }
  *problem = *std::move(created.learning);
  return true;
}

int NumHiddenNeurons(const Network& network) {
  const auto* dense = dynamic_cast<const DenseNetwork*>(&network);
  if (dense == nullptr) return 0;
  int sum = 0;
  for (int layer = 1; layer < dense->num_layers(); ++layer) {
    sum += dense->widths()[layer];
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
                 const LearningRunOptions& options,
                 LearningRunResult* result,
                 std::string* error) {
  const Communicator* const ranks = options.train.communicator.get();
  const bool writes = ranks == nullptr || ranks->rank() == 0;
  const auto agree = [ranks, error](bool ok) {
    return ranks == nullptr ? ok : ranks->Agree(ok, error);
  };
  if (!agree(!writes || (ListRunFiles(options.directory, error) &&
                         MakeDirectories(options.directory, error)))) {
    return false;
  }
  const Network& network = problem.model->network();
  Evaluations evaluations;
  evaluations.tracks_neurons = NumHiddenNeurons(network) <= kMaxTrackedNeurons;
  evaluations.tracked_sample = options.tracked_sample;

  TrainOptions train_options = options.train;
  train_options.inverse = problem.inverse;
  train_options.checkpoint_path = options.directory + "/checkpoint";
  if (problem.metric.has_value()) {
    train_options.metric = [&](const Eigen::VectorXd& weights) {
      return EvaluateMetric(problem, weights);
    };
  }
  train_options.on_evaluation = [&](const Eigen::VectorXd& weights,
                                    const History& /*history*/) {
    evaluations.Add(problem, weights);
  };
  TrainingRun run(*problem.model,
                  {problem.train, problem.test, problem.source},
                  method,
                  train_options);
  *error = run.error();
  if (!error->empty()) return false;
  std::error_code failure;
  // Files of a shorter run that is resumed, not results of this run.
  for (const char* name : {"/result.txt", "/sample_path.csv"}) {
    if (writes) std::filesystem::remove(options.directory + name, failure);
  }
  while (run.Step()) {
    if (!options.on_step) continue;
    double num_stops = options.on_step(run) ? 0.0 : 1.0;
    if (ranks != nullptr) ranks->Sum(&num_stops, 1);
    if (num_stops > 0.0) run.Stop();
  }
  *result = LearningRunResult();
  static_cast<TrainResult&>(*result) = run.result();
  result->label = method.label;
  result->seed = static_cast<int>(train_options.seed);
  const std::vector<NeuronStatistics> final_neurons =
      ComputeNeuronStatistics(network, result->weights, problem.train);
  result->num_saturated = CountSaturated(final_neurons);
  evaluations.MoveTo(result);
  if (!agree(!writes || WriteRunFiles(options.directory,
                                      network,
                                      *result,
                                      run.identity(),
                                      final_neurons,
                                      error))) {
    return false;
  }
  const ceres::TerminationType type = result->summary.termination_type;
  if (writes && type != ceres::USER_SUCCESS && type != ceres::NO_CONVERGENCE) {
    std::filesystem::remove(train_options.checkpoint_path, failure);
  }
  return true;
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
