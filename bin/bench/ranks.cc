// ranks/METHOD/WAY, with mpirun: a run of --steps training steps of each of
// --rules on --problem, with batches of --batch_size samples.
//
//   together   all ranks share each step
//   alone      rank 0 trains in one process, while the others sleep
//
// The counter `sent` is the numbers that rank 0 sent for a step. As many turns
// as --benchmark_repetitions says; the first step, which allocates, is not
// measured.

#include "bin/support/ranks.h"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/learning_run.h"
#include "bin/support/program.h"
#include "bin/support/training_flags.h"
#include "invgrad/method.h"

namespace invgrad {
namespace {

// The times of the steps, but for the first.
bool TimeSteps(const LearningProblem& problem,
               const Method& method,
               const std::shared_ptr<const Communicator>& ranks,
               benchmark::State* state) {
  TrainOptions options = FlagsOptions(problem);
  const std::int64_t num_steps = options.max_num_steps++;
  options.communicator = ranks;
  TrainingRun run(*problem.model,
                  {problem.train, problem.test, problem.source},
                  method,
                  options);
  run.Step();
  const double sent_before = ranks == nullptr ? 0.0 : ranks->num_sent();
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  for (std::int64_t k = 0; k < num_steps; ++k) run.Step();
  const std::chrono::duration<double> seconds = Clock::now() - start;
  state->SetIterationTime(seconds.count());
  if (ranks != nullptr) {
    state->counters["sent"] =
        (ranks->num_sent() - sent_before) / static_cast<double>(num_steps);
  }
  return run.error().empty() && run.step() > num_steps;
}

// Once on every rank: Google Benchmark cannot choose a number that is the same
// on all.
void Measure(const LearningProblem& problem,
             const Method& method,
             bool is_together,
             benchmark::State* state) {
  for (auto _ : *state) {
    bool is_done = true;
    state->SetIterationTime(0.0);
    if (is_together) {
      is_done = TimeSteps(problem, method, ProgramRanks(), state);
    } else if (IsFirstRank()) {
      is_done = TimeSteps(problem, method, nullptr, state);
    }
    WaitForRanks();
    std::string error = "the run ended early";
    if (!AgreeOnRanks(is_done, &error)) state->SkipWithError(error.c_str());
  }
}

}  // namespace

bool AddRankBenchmarks(std::string* error) {
  std::vector<Method> methods;
  if (!CheckBenchTraining(error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
    return false;
  }
  const LearningProblem* problem = FlagsProblem(error);
  if (problem == nullptr) return false;
  for (const Method& method : methods) {
    const auto add = [&](const std::string& way, const std::string& reference) {
      const std::string prefix = "ranks/" + method.label + "/";
      AddBenchmark(prefix + way,
                   reference.empty() ? "" : prefix + reference,
                   [=](auto& state) {
                     Measure(*problem, method, way == "together", &state);
                   })
          ->UseManualTime()
          ->Iterations(1);
    };
    add("together", "");
    add("alone", "together");
  }
  return true;
}

}  // namespace invgrad
