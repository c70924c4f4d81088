/*
Compares the time of a training step of several methods on one problem.

Sample runs:

  bench_training
  bench_training --problem=oscillator_chain --rules=adam,sip,half_inverse \
    --benchmark_repetitions=5
  bench_training --problem=oscillator_chain --rules=adam --batch_size=256 \
    --one_at_a_time --threads=2

Uses one thread. An iteration of a benchmark is a run of --steps steps from the
same weights, including batches and linearizations, but no evaluations of the
loss. The ratios are relative to the first method. With --one_at_a_time every
method also runs with one sample at a time in place of four in lanes, with
--threads=2 also on two threads.
*/

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "bin/support/learning_run.h"
#include "gflags/gflags.h"

DEFINE_string(problem, "sine:xi=32:phi=45", "a problem with a network");
DEFINE_string(rules,
              "adam,sip,sip:proxy=l1,newton/newton/adam:proxy=l1,"
              "newton/numerical/adam",
              "methods; the first one is the reference");
DEFINE_int32(steps, 1000, "steps of a run");
DEFINE_int32(batch_size, -1, "samples a step; 0: all; -1: the problem's own");
DEFINE_bool(one_at_a_time, false, "also without samples in lanes");
DEFINE_int32(threads, 1, "also on so many threads over the samples; 1: no");

namespace invgrad {
namespace {

// A simulator without the functions for batches.
class OneAtATime final : public Simulator {
 public:
  explicit OneAtATime(std::shared_ptr<const Simulator> inner)
      : inner_(std::move(inner)) {}

  int num_inputs() const override { return inner_->num_inputs(); }
  int num_outputs() const override { return inner_->num_outputs(); }
  int num_context() const override { return inner_->num_context(); }
  bool forms_jacobian() const override { return inner_->forms_jacobian(); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    return inner_->Evaluate(x, context, y, jacobian);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    return inner_->Linearize(x, context, y);
  }
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override {
    return inner_->Adjoint(x, context, covector, y, x_bar);
  }

 private:
  std::shared_ptr<const Simulator> inner_;
};

void TrainSteps(benchmark::State& state,
                const LearningProblem& problem,
                const Model& model,
                int num_threads,
                const Method& method) {
  TrainOptions options;
  options.batch_size = BatchSize(problem, FLAGS_batch_size);
  options.max_num_steps = FLAGS_steps;
  options.initial_weights = InitialWeights(problem, 1);
  options.inverse = problem.inverse;
  options.num_threads = num_threads;
  for (auto _ : state) {
    const TrainResult result = Train(model, problem.train, method, options);
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
  if (!CheckFlags({{"steps", {1.0}},
                   {"batch_size", {-1.0}},
                   {"threads", {1.0, 1024.0}}},
                  error) ||
      !ParseFlag("problem", CreateLearningProblem, &problem, error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
    return false;
  }
  const Model& model = *problem.model;
  const std::shared_ptr<const Feedback> feedback(problem.model,
                                                 model.feedback());
  const Model one_at_a_time(
      model.shared_network(),
      std::make_shared<OneAtATime>(model.shared_simulator()),
      model.shared_loss(),
      model.reduction(),
      feedback,
      model.derivatives());
  const auto register_run = [&problem](const std::string& name,
                                       const Model& model,
                                       int num_threads,
                                       const Method& method) {
    RegisterBenchmark(name, [&, num_threads](benchmark::State& state) {
      TrainSteps(state, problem, model, num_threads, method);
    })->UseManualTime();
  };
  const std::string alone = ", one at a time";
  const std::string threaded = fmt::format(", {} threads", FLAGS_threads);
  for (const Method& method : methods) {
    register_run(method.label, model, 1, method);
    if (FLAGS_one_at_a_time) {
      register_run(method.label + alone, one_at_a_time, 1, method);
    }
    if (FLAGS_threads > 1) {
      register_run(method.label + threaded, model, FLAGS_threads, method);
    }
  }
  const std::string why_no_lanes = model.simulator().WhyNoLanes();
  if (!why_no_lanes.empty()) {
    fmt::print("the samples are simulated one at a time: {}\n", why_no_lanes);
  }
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  fmt::print("\nRatios of this run (medians of the repetitions)\n");
  for (size_t i = 1; i < methods.size(); ++i) {
    reporter.PrintRatio(methods[i].label, methods[0].label);
  }
  for (const Method& method : methods) {
    reporter.PrintRatio(method.label + alone, method.label);
    reporter.PrintRatio(method.label, method.label + threaded);
  }
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc, argv, "times a training step of several methods", invgrad::Run);
}
