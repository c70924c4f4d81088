/*
Compares a training step of a U-net through invgrad with the same loop written
directly against libtorch.

Sample runs:

  bench_torch
  bench_torch --resolution=32 --batch_size=32 --benchmark_repetitions=5

The problem is heat; an iteration of a benchmark is a run of --steps steps from
the same weights and on the same batch. `direct` is Adam of libtorch through the
network and the simulator of invgrad.
*/

#include <sys/resource.h>

#include <memory>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "bin/support/learning_run.h"
#include "gflags/gflags.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/rules/rules.h"
#include "invgrad/torch/torch_network.h"
#include "invgrad/torch/u_net_module.h"
#include "invgrad/train/training_memory.h"

DEFINE_int32(resolution, 64, "cells a side");
DEFINE_int32(batch_size, 128, "samples a step");
DEFINE_int32(steps, 3, "steps of a run");

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using torch::Tensor;

constexpr double kStepSize = 1e-3;

// Gradients of 1/2 |P(x) - y*|^2 in x.
Tensor GradientsInX(const Simulator& simulator,
                    const DataSet& batch,
                    const Tensor& x) {
  const Tensor in = x.detach().to(torch::kDouble).contiguous();
  Tensor gradients = torch::empty_like(in);
  const int size = simulator.num_inputs();
  Eigen::VectorXd y(size);
  for (int s = 0; s < batch.num_samples(); ++s) {
    const auto residual = [&](const double* at, double* w) {
      Eigen::Map<Eigen::VectorXd>(w, size) =
          Eigen::Map<const Eigen::VectorXd>(at, size) - batch.targets.col(s);
      return true;
    };
    simulator.Adjoint(in.data_ptr<double>() + s * size,
                      nullptr,
                      residual,
                      y.data(),
                      gradients.data_ptr<double>() + s * size);
  }
  return gradients.to(torch::kFloat);
}

void Direct(benchmark::State& state, const LearningProblem& problem) {
  UNetOptions options;
  options.rows = options.cols = FLAGS_resolution;
  options.periodic = true;
  options.keeps_mean = true;
  const DataSet& batch = problem.train;
  for (auto _ : state) {
    torch::manual_seed(1);
    const TorchFunction function = MakeUNetFunction(options);
    std::vector<Tensor> parameters;
    for (const auto& [name, tensor] : function.parameters) {
      parameters.push_back(tensor);
    }
    torch::optim::Adam adam(parameters, torch::optim::AdamOptions(kStepSize));
    for (int step = 0; step < FLAGS_steps; ++step) {
      const Tensor input =
          torch::from_blob(
              const_cast<double*>(batch.inputs.data()),
              {batch.num_samples(), 1, FLAGS_resolution, FLAGS_resolution},
              torch::kDouble)
              .to(torch::kFloat);
      adam.zero_grad();
      const Tensor x = function.forward(input);
      x.backward(GradientsInX(problem.model->simulator(), batch, x));
      adam.step();
    }
  }
}

void ThroughInvgrad(benchmark::State& state,
                    const LearningProblem& problem,
                    const std::string& method) {
  TrainOptions options;
  options.batch_size = FLAGS_batch_size;
  options.max_num_steps = FLAGS_steps;
  options.initial_weights = InitialWeights(problem, 1);
  options.inverse = problem.inverse;
  for (auto _ : state) {
    const TrainResult result =
        Train(*problem.model, problem.train, method, options);
    CHECK(result.error.empty()) << result.error;
    state.SetIterationTime(result.summary.train_time_in_seconds);
  }
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlags({{"resolution", {8.0, 1024.0}},
                   {"batch_size", {1.0}},
                   {"steps", {1.0}}},
                  error)) {
    return false;
  }
  LearningProblem problem;
  if (!CreateLearningProblem(
          fmt::format("heat:network=u_net:resolution={}:num_samples={}",
                      FLAGS_resolution,
                      FLAGS_batch_size),
          &problem,
          error)) {
    return false;
  }
  RegisterBenchmark("direct", [&](benchmark::State& state) {
    Direct(state, problem);
  })->UseRealTime();
  for (const std::string method : {"dp_adam", "sip"}) {
    RegisterBenchmark(method, [&problem, method](benchmark::State& state) {
      ThroughInvgrad(
          state, problem, fmt::format("{}:step_size={}", method, kStepSize));
    })->UseManualTime();
  }
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto rule = MakeRule("adam");
  fmt::print(
      "\nMemory of a step of dp_adam: {} as stated before a run; {} at "
      "most in use by this process\n",
      FormatBytes(TotalBytes(
          TrainingMemory(*problem.model, *rule, false, FLAGS_batch_size))),
      FormatBytes(1024.0 * usage.ru_maxrss));
  fmt::print("\nRatios of this run (medians of the repetitions)\n");
  reporter.PrintRatio("dp_adam", "direct");
  reporter.PrintRatio("sip", "dp_adam");
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc,
      argv,
      "times a training step of a U-net, through invgrad and directly",
      invgrad::Run);
}
