// Times the half-inverse step and its Jacobian against named alternatives.
//
// Sample runs:
//
//   bench_step
//   bench_step --benchmark_filter=linear_chain --benchmark_repetitions=5
//
// One thread. After the usual lines, the ratios of the same run are printed:
//
//   linear_chain/step            linearization (network, physics), half-inverse
//                                by the Gram route, weights moved: B = 32
//   linear_chain/step_full_svd   the same with J formed and LAPACK dgesdd
//   linear_chain/jacobian        the network's Jacobian factors (and physics)
//   linear_chain/autodiff/S      Ceres' DynamicAutoDiffCostFunction, stride S,
//                                of the same model
//   cubic_chain/...              the nonlinear oscillators, B = 128

#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark.h"
#include "ceres/dynamic_autodiff_cost_function.h"
#include "glog/logging.h"
#include "invgrad/chain/network_functor.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/linalg/blas.h"
#include "invgrad/rules/rules.h"
#include "problems/oscillator_chain.h"

namespace invgrad {
namespace {

struct Chain {
  LearningProblem problem;
  DataSet batch;
  Eigen::VectorXd weights;

  explicit Chain(const std::string& coupling) {
    OscillatorChain::Options options;
    options.coupling = coupling;
    options.num_samples = 512;
    std::string error;
    CHECK(OscillatorChain::Create(options, nullptr, &problem, &error)) << error;
    batch = problem.train.Range(0, problem.batch_size);
    NumpyRandom random(1);
    weights = problem.model->network().InitialWeights(problem.initialization,
                                                      &random);
  }
};

void Step(benchmark::State& state,
          const std::string& coupling,
          const std::string& route) {
  const Chain chain(coupling);
  Specification rule_text{
      "", "half_inverse", {{"truncation", "1e-10"}, {"route", route}}};
  std::string error;
  const std::unique_ptr<UpdateRule> rule = CreateRule(rule_text, &error);
  CHECK(rule != nullptr) << error;
  // The weights move, but not so far that the problem would become another.
  Eigen::VectorXd weights = chain.weights;
  Eigen::VectorXd step;
  for (auto _ : state) {
    Linearization at_weights;
    CHECK(chain.problem.model->Linearize(
        weights, chain.batch, rule->Needs(), &at_weights, &error))
        << error;
    CHECK(rule->ComputeStep(at_weights, &step, &error)) << error;
    weights = chain.weights + 1e-3 * step;
  }
  state.SetLabel(rule->LastStepReport());
}

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
                       NetworkFunctor(chain.problem.model->network()),
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
void RegisterAutoDiff() {
  const std::string name = "linear_chain/autodiff/" + std::to_string(kStride);
  benchmark::RegisterBenchmark(name.c_str(), AutoDiff<kStride>)
      ->Unit(benchmark::kMillisecond);
}

// Keeps the times of a run for the ratios at its end.
class RatioReporter final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    benchmark::ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.error_occurred || run.run_type != Run::RT_Iteration) continue;
      times_[run.run_name.function_name].push_back(run.GetAdjustedRealTime());
    }
  }

  // How many times slower `slow` is than `fast`, by their medians.
  void PrintRatio(const std::string& slow, const std::string& fast) const {
    const double ratio = Median(slow) / Median(fast);
    if (ratio == ratio) {
      std::printf("%-34s / %-28s = %8.1f\n", slow.c_str(), fast.c_str(), ratio);
    }
  }

  // The name of the fastest of those that ran; "" if none did.
  std::string Fastest(const std::vector<std::string>& names) const {
    std::string fastest;
    double least = std::numeric_limits<double>::infinity();
    for (const std::string& name : names) {
      if (Median(name) < least) {
        least = Median(name);
        fastest = name;
      }
    }
    return fastest;
  }

 private:
  // NaN if it did not run.
  double Median(const std::string& name) const {
    const auto it = times_.find(name);
    if (it == times_.end()) return std::numeric_limits<double>::quiet_NaN();
    std::vector<double> sorted = it->second;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }

  std::map<std::string, std::vector<double>> times_;
};

void RegisterAll() {
  for (const std::string coupling : {"linear", "cubic"}) {
    const std::string chain = coupling + "_chain/";
    for (const auto& [name, route] :
         {std::pair<const char*, const char*>{"step", "gram"},
          std::pair<const char*, const char*>{"step_full_svd", "svd"}}) {
      benchmark::RegisterBenchmark(
          (chain + name).c_str(), Step, coupling, std::string(route))
          ->Unit(benchmark::kMillisecond);
    }
    benchmark::RegisterBenchmark(
        (chain + "jacobian").c_str(), JacobianFactors, coupling)
        ->Unit(benchmark::kMillisecond);
  }
  RegisterAutoDiff<4>();
  RegisterAutoDiff<8>();
  RegisterAutoDiff<16>();
  RegisterAutoDiff<32>();
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  invgrad::SetBlasThreads(1);
  invgrad::RegisterAll();
  invgrad::RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  std::printf("\nRatios of this run (medians of the repetitions)\n");
  reporter.PrintRatio("linear_chain/step_full_svd", "linear_chain/step");
  reporter.PrintRatio("cubic_chain/step_full_svd", "cubic_chain/step");
  reporter.PrintRatio(reporter.Fastest({"linear_chain/autodiff/4",
                                        "linear_chain/autodiff/8",
                                        "linear_chain/autodiff/16",
                                        "linear_chain/autodiff/32"}),
                      "linear_chain/jacobian");
  return 0;
}
