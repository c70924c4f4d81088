/*
Compares the time of a training step of several methods on one problem.

Sample runs:

  bench_training
  bench_training --problem=oscillator_chain --rules=adam,sip,half_inverse \
    --benchmark_repetitions=5

Uses one thread. An iteration of a benchmark is a run of --steps steps from the
same weights, including batches and linearizations, but no evaluations of the
loss. The ratios are relative to the first method.
*/

#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "bin/support/learning_run.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas.h"

DEFINE_string(problem, "sine:xi=32:phi=45", "a problem with a network");
DEFINE_string(rules,
              "adam,sip,sip:proxy=l1,newton/newton/adam:proxy=l1,"
              "newton/numerical/adam",
              "methods; the first one is the reference");
DEFINE_int32(steps, 1000, "steps of a run");
DEFINE_int32(batch_size, -1, "samples a step; 0: all; -1: the problem's own");

namespace invgrad {
namespace {

void TrainSteps(benchmark::State& state,
                const LearningProblem& problem,
                const Method& method) {
  TrainOptions options;
  options.batch_size = BatchSize(problem, FLAGS_batch_size);
  options.max_num_steps = FLAGS_steps;
  options.initial_weights = InitialWeights(problem, 1);
  options.inverse = problem.inverse;
  for (auto _ : state) {
    const TrainResult result =
        Train(*problem.model, problem.train, method, options);
    const TrainSummary& summary = result.summary;
    if (!result.error.empty() || summary.num_steps < FLAGS_steps) {
      state.SkipWithError((result.error + summary.message).c_str());
      return;
    }
    state.SetIterationTime(summary.train_time_in_seconds);
  }
}

bool Run(RunCounts* counts, std::string* error) {
  LearningProblem problem;
  std::vector<Method> methods;
  if (!CheckFlags({{"steps", {1.0}}, {"batch_size", {-1.0}}}, error) ||
      !ParseFlag("problem", CreateLearningProblem, &problem, error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
    return false;
  }
  SetBlasThreads(1);
  for (const Method& method : methods) {
    RegisterBenchmark(method.label, [&](benchmark::State& state) {
      TrainSteps(state, problem, method);
    })->UseManualTime();
  }
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  fmt::print("\nRatios of this run (medians of the repetitions)\n");
  for (size_t i = 1; i < methods.size(); ++i) {
    reporter.PrintRatio(methods[i].label, methods[0].label);
  }
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc, argv, "times a training step of several methods", invgrad::Run);
}
