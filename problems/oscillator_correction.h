// Solver in the loop: a coarse simulator of coupled oscillators, corrected by
// the network at every step, must follow a fine simulator.
//
//   s_{t+1} = coarse(s_t) + dt u_t,   u_t = f(s_t; theta),   t = 0 .. T-1
//   coarse:   v <- v + dt a(q),   q <- q + dt v
//   L = 1/T sum_t |s_{t+1} - s*_{t+1}|^2,   s* the fine solution from s_0
//
// where a(q) is the acceleration of the chain with cubic springs, without force
// (oscillator_chain.h). The network's inputs are the corrected states, not the
// states of the fine solution, and the gradient includes the loop [1].
//
// Discretization: coarse: semi-implicit Euler (order 1), T = horizon steps of
//          dt. Fine: classical Runge-Kutta (order 4), 16 steps of dt / 16.
// Shapes:  s = (q, v), u, network input: ns = 2 num_oscillators;  x: T ns;
//          y = (s_1, .., s_T): T ns.
// Data:    np.random.seed(data_seed); np.random.uniform(-1, 1, (2 N,
//          2 num_oscillators)), the states at the start, the first N rows for
//          training, the others for testing.
// Facts:   the fine step is a smooth map of the state, so a large network can
//          make L arbitrarily small. Without correction (u = 0) L is of order
//          dt^2: 0.10 by default.
// Source:  [1] for the setting (there the Navier-Stokes equations); the chain:
//          oscillator_chain.h.
//
// [1] Um, Brand, Fei, Holl, Thuerey. Solver-in-the-Loop: Learning from
//     Differentiable Physics to Interact with Iterative PDE-Solvers. NeurIPS
//     2020. arXiv 2007.00016.
#ifndef PROBLEMS_OSCILLATOR_CORRECTION_H_
#define PROBLEMS_OSCILLATOR_CORRECTION_H_

#include <algorithm>
#include <memory>
#include <string>

#include "fmt/core.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/internal/trajectory_simulator.h"
#include "invgrad/loss.h"
#include "problems/oscillator_chain.h"

namespace invgrad {

// `data`: states at the start, one a row.
struct OscillatorCorrection {
  int num_oscillators = 2;
  int horizon = 16;
  double dt = 0.0;
  int num_samples = 1024;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    set->Add("num_oscillators",
             &num_oscillators,
             {2, kMaxOscillators},
             "length of the chain");
    set->Add("horizon", &horizon, {1, 1e5}, "steps, T");
    set->Add("dt",
             &dt,
             {0, 1},
             "length of a coarse step; 0: 0.25, of more than two oscillators "
             "0.125");
    DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
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

  bool Create(LearningProblem* problem, std::string* error) const {
    const int state_size = 2 * num_oscillators;
    const SampleSize sample_size = {
        num_samples,
        state_size,
        state_size * (2.0 + horizon),
        fmt::format(
            ":num_oscillators={}:horizon={}", num_oscillators, horizon)};
    if (!MakeUniformData(sample_size, -1.0, 1.0, data_seed, problem, error)) {
      return false;
    }
    DataSet all;
    all.inputs = problem->data.transpose();
    all.contexts = all.inputs;
    all.targets = FineTrajectories(all.contexts);
    if (!all.targets.allFinite()) {
      *error =
          "the fine solution from one of the states at the start is not finite";
      return false;
    }
    SplitSamples(all, 16, problem);
    problem->num_epochs = 25;
    // The step for two oscillators and their corrections has eight variables.
    num_oscillators == 2 ? SetModel<2, 8>(problem) : SetModel<0, 8>(problem);
    return true;
  }

 private:
  // Between two others an oscillator has two springs: 0.25 is too long for the
  // coarse method in front of most initial networks.
  double StepLength() const {
    return dt > 0.0 ? dt : num_oscillators == 2 ? 0.25 : 0.125;
  }

  template <int kNumOscillators>
  OscillatorStep<kNumOscillators> CubicChain(double step_length) const {
    return {num_oscillators,
            step_length,
            /*linear=*/0.0,
            /*cubic=*/1.0,
            /*control=*/0.0};
  }

  template <int kNumOscillators, int kStride>
  void SetModel(LearningProblem* problem) const {
    using Step = CorrectedStep<kNumOscillators>;
    const int size = 2 * num_oscillators;
    const auto simulator =
        std::make_shared<TrajectorySimulator<Step, WholeState, kStride>>(
            Step{CubicChain<kNumOscillators>(StepLength())},
            WholeState{size},
            size,
            size,
            size,
            horizon);
    problem->model = std::make_shared<Model>(
        DenseNetwork({size, 16, 16, size}, Activation::kTanh),
        simulator,
        std::make_shared<SquaredNormLoss>(simulator->num_outputs(),
                                          1.0 / horizon),
        Reduction::kMean,
        simulator);
  }

  // (s_1, .., s_T) of the fine solution, one column a sample.
  Eigen::MatrixXd FineTrajectories(const Eigen::MatrixXd& starts) const {
    constexpr int kFineStepsPerStep = 16;
    const auto step = CubicChain<0>(StepLength() / kFineStepsPerStep);
    const double no_force = 0.0;
    const Eigen::Index size = starts.rows();
    Eigen::MatrixXd trajectories(size * horizon, starts.cols());
    Eigen::VectorXd next(size);
    for (Eigen::Index s = 0; s < starts.cols(); ++s) {
      Eigen::VectorXd state = starts.col(s);
      for (int t = 0; t < horizon; ++t) {
        for (int k = 0; k < kFineStepsPerStep; ++k) {
          step(state.data(), &no_force, next.data());
          state.swap(next);
        }
        trajectories.col(s).segment(t * size, size) = state;
      }
    }
    return trajectories;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_OSCILLATOR_CORRECTION_H_
