/*
Measures what several ranks gain in training, against one process, in one run.

Sample runs:

  mpirun -n 2 rank_speedup
  mpirun -n 2 rank_speedup --samples=1024 --method=half_inverse --hidden=100-100
  mpirun -n 2 rank_speedup --samples=32 --method=adam \
    --problem=oscillator_chain:num_oscillators=16:num_steps=1000

In turns, rank 0 trains alone, while the others sleep, and all ranks train
together; both begin with the same weights. Prints the times of a step, the
median over the turns of their ratio with its range, and the numbers that rank 0
sent for a step.
*/

#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bin/support/learning_run.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/train/train.h"
#include "problems/problem.h"

DEFINE_string(problem, "oscillator_chain", "name[:key=value...]");
DEFINE_string(method, "half_inverse", "a method of compare");
DEFINE_int32(samples, 256, "samples of a step, which the ranks share");
DEFINE_int32(steps_per_turn, 10, "timed steps");
DEFINE_int32(turns, 5, "turns");

namespace invgrad {
namespace {

// Waits for all ranks without using the processor.
void SleepUntilAllArrive() {
  MPI_Request request;
  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  for (int has_come = 0; has_come == 0;) {
    MPI_Test(&request, &has_come, MPI_STATUS_IGNORE);
    constexpr std::chrono::milliseconds kPause(1);
    if (has_come == 0) std::this_thread::sleep_for(kPause);
  }
}

// Milliseconds of a step; the first step, which allocates, does not count.
bool TimeSteps(const LearningProblem& problem,
               const std::shared_ptr<const Communicator>& ranks,
               double* milliseconds,
               double* num_sent,
               std::string* error) {
  TrainOptions options;
  options.initial_weights = InitialWeights(problem, 1);
  options.batch_size = FLAGS_samples;
  options.max_num_steps = FLAGS_steps_per_turn + 1;
  options.inverse = problem.inverse;
  options.communicator = ranks;
  TrainingRun run(*problem.model,
                  {problem.train, problem.test, problem.source},
                  FLAGS_method,
                  options);
  run.Step();
  const double sent_before = ranks == nullptr ? 0.0 : ranks->num_sent();
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  for (int k = 0; k < FLAGS_steps_per_turn; ++k) run.Step();
  const std::chrono::duration<double> seconds = Clock::now() - start;
  *error = run.error();
  if (error->empty() && run.step() <= FLAGS_steps_per_turn) {
    *error = "the run ended early: " + run.summary().message;
  }
  *milliseconds = 1e3 * seconds.count() / FLAGS_steps_per_turn;
  if (ranks != nullptr) {
    *num_sent = (ranks->num_sent() - sent_before) / FLAGS_steps_per_turn;
  }
  return error->empty();
}

std::string Range(std::vector<double> values, const char* unit) {
  std::sort(values.begin(), values.end());
  return fmt::format("{:.3g}{} ({:.3g} to {:.3g})",
                     values[values.size() / 2],
                     unit,
                     values.front(),
                     values.back());
}

bool Run(RunCounts* counts, std::string* error) {
  LearningProblem problem;
  if (!CheckFlags({{"samples", {1.0, 1e9}},
                   {"steps_per_turn", {1.0, 1e6}},
                   {"turns", {1.0, 1e6}}},
                  error) ||
      !NameFlag("problem",
                CreateLearningProblem(FLAGS_problem, &problem, error),
                error)) {
    return false;
  }
  if (!SetNetwork(NetworkOfFlags(), &problem, error)) {
    *error = "--" + *error;
    return false;
  }
  if (NumRanks() == 1) {
    *error = "start it on several ranks: mpirun -n 2 rank_speedup";
    return false;
  }
  std::vector<double> alone, together, ratios;
  double num_sent = 0.0;
  for (int turn = 0; turn < FLAGS_turns; ++turn) {
    double own = 0.0, shared = 0.0;
    bool is_done = true;
    if (IsFirstRank()) {
      is_done = TimeSteps(problem, nullptr, &own, &num_sent, error);
    }
    SleepUntilAllArrive();
    if (!AgreeOnRanks(is_done, error) ||
        !TimeSteps(problem, ProgramRanks(), &shared, &num_sent, error)) {
      return false;
    }
    alone.push_back(own);
    together.push_back(shared);
    ratios.push_back(own / shared);
  }
  std::cout << fmt::format(
      "{}, {}, batch {}, {} ranks\n"
      "  one process        {} a step\n"
      "  {} ranks            {} a step\n"
      "  times as fast      {}\n"
      "  numbers sent       {:.4g} a step by rank 0\n",
      FLAGS_problem,
      FLAGS_method,
      FLAGS_samples,
      NumRanks(),
      Range(alone, " ms"),
      NumRanks(),
      Range(together, " ms"),
      Range(ratios, ""),
      num_sent);
  counts->Add(true);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgramOnRanks(
      argc,
      argv,
      "measures what several ranks gain in training\n\n"
      "  mpirun -n 2 rank_speedup --method=adam",
      invgrad::Run);
}
