/*
Compares the time of a training step of several methods on one problem, as
ratios within one run.

Sample runs:

  bench_training
  bench_training --problem=oscillator_chain --rules=adam,sip,half_inverse \
    --benchmark_repetitions=5

Uses one thread. An iteration of a benchmark is a run of --steps steps from the
same weights, including batches and linearizations, but no evaluations of the
loss. The ratios are relative to the first method.
*/

#include <cstdio>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/program.h"
#include "bin/support/ratio_reporter.h"
#include "bin/support/training.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "problems/problems.h"

DEFINE_string(problem, "sine:xi=32:phi=45", "a problem with a network");
DEFINE_string(rules,
              "adam,sip,sip:proxy=l1,newton/newton/adam:proxy=l1,"
              "newton/numerical/adam",
              "methods; the first one is the reference");
DEFINE_int32(steps, 1000, "steps of a run");

namespace invgrad {
namespace {

void TrainSteps(benchmark::State& state,
                const LearningProblem& problem,
                const Method& method) {
  TrainOptions options;
  options.batch_size = BatchSize(problem, /*flag_batch_size=*/-1);
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

int Run() {
  std::string error;
  PhysicsProblem problem;
  std::vector<Method> methods;
  if (!CreateProblem(FLAGS_problem, nullptr, &problem, &error)) {
    return Fail(error);
  }
  if (!problem.learning.has_value()) {
    return Fail("--problem=" + FLAGS_problem + " has no network to train");
  }
  if (!ParseMethods(FLAGS_rules, &methods, &error)) {
    return Fail("--rules: " + error);
  }
  if (FLAGS_steps < 1) return Fail("--steps: allowed: 1 or more");
  SetBlasThreads(1);
  for (const Method& method : methods) {
    benchmark::RegisterBenchmark(method.label.c_str(),
                                 [&](benchmark::State& state) {
                                   TrainSteps(state, *problem.learning, method);
                                 })
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  }
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  std::printf("\nRatios of this run (medians of the repetitions)\n");
  for (size_t i = 1; i < methods.size(); ++i) {
    reporter.PrintRatio(methods[i].label, methods[0].label);
  }
  return 0;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  // Google Benchmark removes its flags from argv.
  benchmark::Initialize(&argc, argv);
  return invgrad::RunProgram(
      argc, argv, "times a training step of several methods", invgrad::Run);
}
