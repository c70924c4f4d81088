// torch/METHOD: three training steps of a U-net on heat, 64 x 64 cells and 128
// samples, from the same weights and on the same batch.
//
//   direct   libtorch's Adam, through the network and the simulator of invgrad
//   dp_adam  the same through invgrad
//   sip      with the inverse simulator, beside dp_adam

#include <memory>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/learning_run.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/torch/u_net_module.h"
#include "invgrad/torch_network.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using torch::Tensor;

constexpr int kResolution = 64;
constexpr int kBatchSize = 128;
constexpr int kSteps = 3;
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

const LearningProblem& Problem() {
  static const auto& problem = *[] {
    auto* made = new LearningProblem;
    std::string error;
    CHECK(CreateLearningProblem(
        fmt::format("heat:network=u_net:resolution={}:num_samples={}",
                    kResolution,
                    kBatchSize),
        made,
        &error))
        << error;
    return made;
  }();
  return problem;
}

void Direct(benchmark::State& state) {
  const LearningProblem& problem = Problem();
  UNetOptions options;
  options.rows = options.cols = kResolution;
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
    for (int step = 0; step < kSteps; ++step) {
      const Tensor input =
          torch::from_blob(const_cast<double*>(batch.inputs.data()),
                           {batch.num_samples(), 1, kResolution, kResolution},
                           torch::kDouble)
              .to(torch::kFloat);
      adam.zero_grad();
      const Tensor x = function.forward(input);
      x.backward(GradientsInX(problem.model->simulator(), batch, x));
      adam.step();
    }
  }
}

void ThroughInvgrad(const std::string& method, benchmark::State& state) {
  const LearningProblem& problem = Problem();
  TrainOptions options;
  options.batch_size = kBatchSize;
  options.max_num_steps = kSteps;
  options.initial_weights = InitialWeights(problem, 1);
  options.inverse = problem.inverse;
  for (auto _ : state) {
    const TrainResult result =
        Train(*problem.model,
              problem.train,
              fmt::format("{}:step_size={}", method, kStepSize),
              options);
    CHECK(result.error.empty()) << result.error;
    state.SetIterationTime(result.summary.train_time_in_seconds);
  }
}

}  // namespace

bool AddTorchBenchmarks(std::string* /*error*/) {
  AddBenchmark("torch/direct", "", Direct)->UseRealTime();
  const auto add = [](const std::string& method, const std::string& reference) {
    AddBenchmark("torch/" + method,
                 "torch/" + reference,
                 [method](auto& state) { ThroughInvgrad(method, state); })
        ->UseManualTime();
  };
  add("dp_adam", "direct");
  add("sip", "dp_adam");
  return true;
}

}  // namespace invgrad
