#include "bin/support/training.h"

#include <algorithm>
#include <cstdint>

#include "fmt/core.h"
#include "invgrad/io/format.h"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

Eigen::VectorXd InitialWeights(const LearningProblem& problem, int seed) {
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  return problem.model->network().InitialWeights(problem.initialization,
                                                 &random);
}

int BatchSize(const LearningProblem& problem, int flag_batch_size) {
  return BatchSize(problem, Phase(), flag_batch_size);
}

int BatchSize(const LearningProblem& problem,
              const Phase& phase,
              int flag_batch_size) {
  int batch_size = problem.batch_size;
  if (flag_batch_size >= 0) batch_size = flag_batch_size;
  if (phase.batch_size >= 0) batch_size = phase.batch_size;
  return batch_size == 0 ? problem.train.num_samples() : batch_size;
}

bool CheckBatches(const LearningProblem& problem,
                  const std::vector<Method>& methods,
                  int flag_batch_size,
                  std::string* error) {
  const int num_samples = problem.train.num_samples();
  const auto refuse = [&](const std::string& what, int batch_size) {
    *error = fmt::format(
        "{}batch_size={} is out of range; allowed: 1 to the {} training "
        "samples, or 0 for all",
        what,
        batch_size,
        num_samples);
    return false;
  };
  if (flag_batch_size > num_samples) return refuse("--", flag_batch_size);
  for (const Method& method : methods) {
    for (const Phase& phase : method.phases) {
      if (BatchSize(problem, phase, flag_batch_size) > num_samples) {
        return refuse("--rules: " + method.label + ": ", phase.batch_size);
      }
    }
  }
  return problem.train.IsFinite(error) && problem.test.IsFinite(error);
}

void AddLeftOutSamples(const Method& method,
                       int batch_size,
                       int num_samples,
                       std::set<std::string>* warnings) {
  for (const Phase& phase : method.phases) {
    if (phase.ceres != nullptr) continue;
    int own = phase.batch_size >= 0 ? phase.batch_size : batch_size;
    if (own == 0) own = num_samples;
    if (num_samples % own == 0) continue;
    int below = own, above = own;
    while (num_samples % below != 0) --below;
    while (num_samples % above != 0) ++above;
    warnings->insert(
        fmt::format("batch_size={}: {} of {} samples are left out of every "
                    "epoch; divisors near: {}, {}",
                    own,
                    num_samples % own,
                    num_samples,
                    below,
                    above));
  }
}

bool LoadCompleteRun(const std::string& directory,
                     const LearningProblem& problem,
                     const TrainOptions& options,
                     LearningRunResult* result,
                     std::string* error) {
  return LoadLearningRun(directory, problem, result, error) &&
         !HasBudgetLeft(*result, options);
}

double MillisecondsPerStep(const LearningRunResult& run) {
  return run.summary.num_steps > 0
             ? 1e3 * run.summary.train_time_in_seconds /
                   static_cast<double>(run.summary.num_steps)
             : HistoryRow::kNone;
}

void AddTimes(const LearningRunResult& run, bool is_there, Table* table) {
  const auto add = [&](const std::string& title, const std::string& cell) {
    table->Add(title, is_there ? cell : "-");
  };
  add("steps", std::to_string(run.summary.num_steps));
  add("s", FormatNumber(run.summary.train_time_in_seconds));
  add("ms/step", NumberOrDash(MillisecondsPerStep(run)));
}

}  // namespace invgrad
