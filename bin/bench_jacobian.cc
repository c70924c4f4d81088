// Compares the time of the Jacobian of network and simulator with automatic
// differentiation of both.
//
// Sample runs:
//
//   bench_jacobian
//   bench_jacobian --benchmark_repetitions=5
//
// Uses one thread. After the usual lines it prints the ratio within this run:
//
//   linear_chain/jacobian     the network's Jacobian factors, and physics
//   linear_chain/autodiff/S   Ceres' DynamicAutoDiffCostFunction, stride S, of
//                             the same model: B = 32, m = 128, n = 1,444
//   cubic_chain/jacobian      the nonlinear oscillators, B = 128

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "bin/support/learning_run.h"
#include "ceres/dynamic_autodiff_cost_function.h"
#include "glog/logging.h"
#include "invgrad/chain/network_functor.h"
#include "invgrad/chain/network_jacobian.h"
#include "problems/oscillator_chain.h"

namespace invgrad {
namespace {

struct Chain {
  LearningProblem problem;
  DataSet batch;
  Eigen::VectorXd weights;

  explicit Chain(const std::string& coupling) {
    std::string error;
    CHECK(CreateLearningProblem(
        "oscillator_chain:num_samples=512:coupling=" + coupling,
        &problem,
        &error))
        << error;
    batch = problem.train.Range(0, problem.batch_size);
    weights = InitialWeights(problem, 1);
  }
};

void JacobianFactors(benchmark::State& state, const std::string& coupling) {
  const Chain chain(coupling);
  LinearizationParts parts;
  parts.jacobian = true;
  std::string error;
  for (auto _ : state) {
    Linearization at_weights;
    CHECK(chain.problem.model->Linearize(
        chain.weights, chain.batch, parts, &at_weights, &error))
        << error;
    benchmark::DoNotOptimize(
        static_cast<const NetworkJacobian&>(*at_weights.jacobian)
            .Layer(0)
            .deltas()
            .data());
  }
}

// The same batch as one Ceres functor: network and physics on Jets.
struct ChainFunctor {
  const Chain* chain;
  NetworkFunctor network;
  OscillatorStep<2> step;

  template <typename T>
  bool operator()(T const* const* parameters, T* residuals) const {
    const DataSet& batch = chain->batch;
    const int num_steps = chain->problem.model->network().num_outputs();
    const int state_size = static_cast<int>(batch.inputs.rows());
    std::vector<T> inputs(state_size), next(state_size), control(num_steps);
    for (int s = 0; s < batch.num_samples(); ++s) {
      for (int i = 0; i < state_size; ++i) inputs[i] = T(batch.inputs(i, s));
      network(parameters[0], inputs.data(), control.data());
      for (int t = 0; t < num_steps; ++t) {
        step(inputs.data(), &control[t], next.data());
        inputs.swap(next);
      }
      for (int i = 0; i < state_size; ++i) {
        *residuals++ = inputs[i] - batch.targets(i, s);
      }
    }
    return true;
  }
};

template <int kStride>
void AutoDiff(benchmark::State& state) {
  const Chain chain("linear");
  ceres::DynamicAutoDiffCostFunction<ChainFunctor, kStride> cost_function(
      new ChainFunctor{&chain,
                       NetworkFunctor(*chain.problem.model->dense_network()),
                       OscillatorStep<2>()});
  const int n = chain.problem.model->num_weights();
  const int m = static_cast<int>(chain.batch.targets.size());
  cost_function.AddParameterBlock(n);
  cost_function.SetNumResiduals(m);
  const double* parameters[] = {chain.weights.data()};
  std::vector<double> jacobian(static_cast<size_t>(m) * n), residuals(m);
  double* jacobians[] = {jacobian.data()};
  for (auto _ : state) {
    CHECK(cost_function.Evaluate(parameters, residuals.data(), jacobians));
  }
}

template <int kStride>
std::string RegisterAutoDiff() {
  std::string name = fmt::format("linear_chain/autodiff/{}", kStride);
  RegisterBenchmark(name, AutoDiff<kStride>);
  return name;
}

bool Run(RunCounts* counts, std::string* /*error*/) {
  for (const std::string coupling : {"linear", "cubic"}) {
    RegisterBenchmark(coupling + "_chain/jacobian",
                      [coupling](benchmark::State& state) {
                        JacobianFactors(state, coupling);
                      });
  }
  const std::string strides[] = {RegisterAutoDiff<4>(),
                                 RegisterAutoDiff<8>(),
                                 RegisterAutoDiff<16>(),
                                 RegisterAutoDiff<32>()};
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  fmt::print("\nRatio of this run (medians of the repetitions)\n");
  reporter.PrintRatio(
      *std::min_element(std::begin(strides),
                        std::end(strides),
                        [&reporter](const auto& a, const auto& b) {
                          return reporter.Median(a) < reporter.Median(b);
                        }),
      "linear_chain/jacobian");
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc,
      argv,
      "times the Jacobian of network and simulator by each method",
      invgrad::Run);
}
