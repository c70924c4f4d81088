#include "problems/oscillator_chain.h"

#include <memory>

#include "fmt/core.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/loss.h"
#include "invgrad/time_stepping_simulator.h"

namespace invgrad {

namespace {

template <int kNumOscillators, int kStride>
std::shared_ptr<const Simulator> MakeSimulator(int num_oscillators,
                                               bool is_cubic,
                                               int num_steps) {
  using Step = OscillatorStep<kNumOscillators>;
  const Step step = is_cubic ? Step{num_oscillators, 0.125, 0.0, 1.0, 3.0}
                             : Step{num_oscillators, 0.5, 0.2, 0.0, 1.0};
  return std::make_shared<TimeSteppingSimulator<Step, kStride>>(
      step, 2 * num_oscillators, 1, num_steps);
}

}  // namespace

void OscillatorChain::Describe(OptionSet* set) {
  set->Add("coupling",
           &coupling,
           {"linear", "cubic"},
           "linear: PBDL notebook; cubic: HIG release");
  set->Add("num_oscillators",
           &num_oscillators,
           {2, kMaxOscillators},
           "length of the chain");
  set->Add("num_steps",
           &num_steps,
           {0, 1e5},
           "time steps; 0: 24 linear, 96 cubic, as published");
  DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
  DescribeTargetNoise(&noise, set);
}

bool OscillatorChain::Create(LearningProblem* problem,
                             std::string* error) const {
  const bool is_cubic = coupling == "cubic";
  const int steps = num_steps > 0 ? num_steps : is_cubic ? 96 : 24;
  const int state_size = 2 * num_oscillators;
  const SampleSize sample_size = {
      num_samples,
      state_size,
      3.0 * state_size,
      fmt::format(":num_oscillators={}", num_oscillators)};
  if (!MakeUniformData(sample_size, 0.0, 1.0, data_seed, problem, error)) {
    return false;
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = all.inputs;
  SplitSamples(all, is_cubic ? 128 : 32, problem);
  AddTargetNoise(noise, data_seed, problem);
  problem->num_epochs = 25;
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 20, 20, 20, steps},
                   is_cubic ? Activation::kRelu : Activation::kTanh),
      // The step for two oscillators and their force has five variables: one
      // pass of Jets.
      num_oscillators == 2
          ? MakeSimulator<2, 5>(2, is_cubic, steps)
          : MakeSimulator<0, 8>(num_oscillators, is_cubic, steps),
      std::make_shared<SquaredNormLoss>(state_size, 1.0),
      Reduction::kMean);
  return true;
}

}  // namespace invgrad
