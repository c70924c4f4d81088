#include "problems/oscillator_correction.h"

#include <algorithm>
#include <memory>

#include "fmt/core.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/trajectory_simulator.h"
#include "problems/oscillator_chain.h"
#include "problems/sample_data.h"

namespace invgrad {

namespace {

constexpr int kFineStepsPerStep = 16;

template <int kNumOscillators>
OscillatorStep<kNumOscillators> CubicChain(int num_oscillators, double dt) {
  return {num_oscillators, dt, /*linear=*/0.0, /*cubic=*/1.0, /*control=*/0.0};
}

template <int kNumOscillators>
struct CorrectedStep {
  OscillatorStep<kNumOscillators> chain;

  template <typename T>
  bool operator()(const T* state, const T* correction, T* next_state) const {
    const int n = chain.count();
    T rate[2 * OscillatorStep<kNumOscillators>::kCapacity] = {};
    chain.Derivative(state, T(0.0), rate);
    for (int i = 0; i < n; ++i) {
      const T v = state[n + i] + chain.dt * rate[n + i];
      next_state[i] = state[i] + chain.dt * (v + correction[i]);
      next_state[n + i] = v + chain.dt * correction[n + i];
    }
    return true;
  }
};

struct WholeState {
  int size = 4;
  template <typename T>
  bool operator()(int /*t*/,
                  const T* next_state,
                  const T* /*correction*/,
                  T* output) const {
    std::copy_n(next_state, size, output);
    return true;
  }
};

template <int kNumOscillators, int kStride>
void SetModel(const OscillatorCorrection& options, LearningProblem* problem) {
  const int state_size = 2 * options.num_oscillators;
  const auto simulator = std::make_shared<
      TrajectorySimulator<CorrectedStep<kNumOscillators>, WholeState, kStride>>(
      CorrectedStep<kNumOscillators>{
          CubicChain<kNumOscillators>(options.num_oscillators, options.dt)},
      WholeState{state_size},
      state_size,
      state_size,
      state_size,
      options.horizon);
  problem->model = std::make_shared<Model>(
      DenseNetwork({state_size, 16, 16, state_size}, Activation::kTanh),
      simulator,
      std::make_shared<SquaredNormLoss>(simulator->num_outputs(),
                                        1.0 / options.horizon),
      Reduction::kMean,
      simulator);
}

// (s_1, .., s_T) of the fine solution, one column a sample.
Eigen::MatrixXd FineTrajectories(const OscillatorCorrection& options,
                                 const Eigen::MatrixXd& starts) {
  const auto step =
      CubicChain<0>(options.num_oscillators, options.dt / kFineStepsPerStep);
  const double no_force = 0.0;
  const Eigen::Index size = starts.rows();
  Eigen::MatrixXd trajectories(size * options.horizon, starts.cols());
  Eigen::VectorXd next(size);
  for (Eigen::Index s = 0; s < starts.cols(); ++s) {
    Eigen::VectorXd state = starts.col(s);
    for (int t = 0; t < options.horizon; ++t) {
      for (int k = 0; k < kFineStepsPerStep; ++k) {
        step(state.data(), &no_force, next.data());
        state.swap(next);
      }
      trajectories.col(s).segment(t * size, size) = state;
    }
  }
  return trajectories;
}

}  // namespace

void OscillatorCorrection::Describe(OptionSet* set) {
  set->Add("num_oscillators",
           &num_oscillators,
           {2, kMaxOscillators},
           "length of the chain");
  set->Add("horizon", &horizon, {1, 1e5}, "steps, T");
  set->Add("dt", &dt, {1e-9, 1}, "length of a coarse step");
  DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
}

bool OscillatorCorrection::Create(LearningProblem* problem,
                                  std::string* error) const {
  const int state_size = 2 * num_oscillators;
  const SampleSize sample_size = {
      num_samples,
      state_size,
      state_size * (2.0 + horizon),
      fmt::format(":num_oscillators={}:horizon={}", num_oscillators, horizon)};
  if (!MakeUniformData(sample_size, -1.0, 1.0, data_seed, problem, error)) {
    return false;
  }
  DataSet all;
  all.inputs = problem->data.transpose();
  all.contexts = all.inputs;
  all.targets = FineTrajectories(*this, all.contexts);
  if (!all.targets.allFinite()) {
    *error =
        "the fine solution from one of the states at the start is not finite";
    return false;
  }
  SplitSamples(all, 16, problem);
  problem->num_epochs = 25;
  // The step for two oscillators and their corrections has eight variables.
  num_oscillators == 2 ? SetModel<2, 8>(*this, problem)
                       : SetModel<0, 8>(*this, problem);
  return true;
}

}  // namespace invgrad
