#include "problems/oscillator_chain.h"

#include "fmt/core.h"

namespace invgrad {

namespace {

struct Physics {
  int num_steps = 24;
  double dt = 0.5;
  double linear = 0.2;
  double cubic = 0.0;
  double control = 1.0;
};

template <int kNumOscillators, int kStride>
std::shared_ptr<const Simulator> MakeSimulator(const Physics& physics,
                                               int num_oscillators) {
  OscillatorStep<kNumOscillators> step;
  step.num_oscillators = num_oscillators;
  step.dt = physics.dt;
  step.linear = physics.linear;
  step.cubic = physics.cubic;
  step.control = physics.control;
  return std::make_shared<
      TimeSteppingSimulator<OscillatorStep<kNumOscillators>, kStride>>(
      step, 2 * num_oscillators, 1, physics.num_steps);
}

}  // namespace

bool OscillatorChain::Create(const Options& options,
                             const Eigen::MatrixXd* data,
                             LearningProblem* problem,
                             std::string* error) {
  Physics physics;
  Activation activation = Activation::kTanh;
  int batch_size = 32;
  if (options.coupling == "cubic") {
    physics = {96, 0.125, 0.0, 1.0, 3.0};
    activation = Activation::kRelu;
    batch_size = 128;
  }
  const int state_size = 2 * options.num_oscillators;
  const auto generate = [&](int num_rows) {
    return UniformData(0.0, 1.0, num_rows, state_size, options.data_seed);
  };
  if (!MakeData({options.num_samples,
                 state_size,
                 3.0 * state_size,
                 fmt::format(":num_oscillators={}", options.num_oscillators)},
                data,
                generate,
                problem,
                error)) {
    return false;
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = all.inputs;
  SplitSamples(all, batch_size, problem);
  AddTargetNoise(options.noise, options.data_seed, problem);
  problem->num_epochs = 25;
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 20, 20, 20, physics.num_steps}, activation),
      // The step for two oscillators and their force has five variables: one
      // pass of Jets.
      options.num_oscillators == 2
          ? MakeSimulator<2, 6>(physics, 2)
          : MakeSimulator<0, 8>(physics, options.num_oscillators),
      std::make_shared<SquaredNormLoss>(state_size, 1.0),
      Reduction::kMean);
  return true;
}

}  // namespace invgrad
