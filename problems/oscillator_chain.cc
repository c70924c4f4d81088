#include "problems/oscillator_chain.h"

#include <algorithm>

namespace invgrad {

namespace {

Activation HiddenActivation(const OscillatorChain::Options& options) {
  if (options.activation == "tanh") return Activation::kTanh;
  if (options.activation == "relu") return Activation::kRelu;
  if (options.activation == "gelu") return Activation::kGelu;
  if (options.activation == "sigmoid") return Activation::kSigmoid;
  return options.coupling == "linear" ? Activation::kTanh : Activation::kRelu;
}

std::shared_ptr<const Simulator> MakeSimulator(const OscillatorStep& step,
                                               int num_steps) {
  const int state_size = 2 * step.num_oscillators;
  // Two oscillators and their force are five variables: one pass of Jets.
  if (step.num_oscillators == 2) {
    return std::make_shared<TimeSteppingSimulator<OscillatorStep, 5>>(
        step, state_size, 1, num_steps);
  }
  return std::make_shared<TimeSteppingSimulator<OscillatorStep, 8>>(
      step, state_size, 1, num_steps);
}

}  // namespace

bool OscillatorChain::Create(const Options& options,
                             const Eigen::MatrixXd* data,
                             LearningProblem* problem,
                             std::string* error) {
  OscillatorStep step;
  step.num_oscillators = options.num_oscillators;
  int num_steps = 24;
  problem->batch_size = 32;
  if (options.coupling == "cubic") {
    step.dt = 0.125;
    step.linear = 0.0;
    step.cubic = 1.0;
    step.control = 3.0;
    num_steps = 96;
    problem->batch_size = 128;
  }
  const int state_size = 2 * options.num_oscillators;
  if (data != nullptr) {
    if (data->cols() != state_size || data->rows() < 2) {
      *error = "oscillator_chain: data must have shape (2 samples or more, " +
               std::to_string(state_size) + "), found (" +
               std::to_string(data->rows()) + ", " +
               std::to_string(data->cols()) + ")";
      return false;
    }
    problem->data = *data;
  } else {
    problem->data = NumpyRandom(static_cast<std::uint32_t>(options.data_seed))
                        .Rand(2 * options.num_samples, state_size);
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = all.inputs;
  const int num_train = all.num_samples() / 2;
  problem->train = all.Range(0, num_train);
  problem->test = all.Range(num_train, all.num_samples() - num_train);
  problem->batch_size = std::min(problem->batch_size, num_train);
  problem->num_epochs = 25;
  problem->initialization = Initialization::kGlorotUniform;
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 20, 20, 20, num_steps},
                   HiddenActivation(options)),
      MakeSimulator(step, num_steps),
      std::make_shared<SquaredNormLoss>(state_size, 1.0),
      Reduction::kMean);
  return true;
}

}  // namespace invgrad
