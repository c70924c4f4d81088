// jacobian/CASE/METHOD: the Jacobian of network and simulator. Methods:
//
//   factors      the network's Jacobian factors, and physics
//   autodiff_S   Ceres' DynamicAutoDiffCostFunction, stride S, of the same
//                model: B = 32, m = 128, n = 1,444
//
// of the linear chain of oscillators; of the nonlinear one, B = 128, factors.

#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/learning_run.h"
#include "ceres/dynamic_autodiff_cost_function.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/dense_network.h"
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
void AddAutoDiff() {
  AddBenchmark(fmt::format("jacobian/linear_chain/autodiff_{}", kStride),
               "jacobian/linear_chain/factors",
               AutoDiff<kStride>);
}

}  // namespace

bool AddJacobianBenchmarks(std::string* /*error*/) {
  for (const std::string coupling : {"linear", "cubic"}) {
    AddBenchmark("jacobian/" + coupling + "_chain/factors",
                 "",
                 [coupling](benchmark::State& state) {
                   JacobianFactors(state, coupling);
                 });
  }
  AddAutoDiff<4>();
  AddAutoDiff<8>();
  AddAutoDiff<16>();
  AddAutoDiff<32>();
  return true;
}

}  // namespace invgrad
