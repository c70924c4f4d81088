// A chain of coupled oscillators that a force on the last one must bring back.
//
//   q' = v
//   v_i' = -q_i + sum_{j = i-1, i+1} [linear (q_j - q_i) + cubic (q_j - q_i)^3]
//              + (i = last) control u(t)
//   x = (u_1, ..., u_Nt),   y = (q, v)(T),   L = |y - y*|^2,   y* = (q, v)(0)
//
// The network maps the state (q, v)(0) to the forces of all time steps. The
// ends of the chain are free.
//
// Discretization: classical Runge-Kutta (order 4), Nt steps of dt, u
//          constant in a step.
// Shapes:  state, network input and y: 2 num_oscillators;  x: Nt.
// Units:   none (unit mass and unit spring to the ground).
// Data:    np.random.seed(data_seed); np.random.rand(2 N, 2 num_oscillators),
//          the first N rows for training, the others for testing.
// Settings: coupling=linear (PBDL notebook): Nt 24, dt 0.5, linear 0.2,
//          control 1, network 4-20-20-20-24 tanh, B 32.
//          coupling=cubic (HIG release): Nt 96, dt 0.125, cubic 1, control 3,
//          network 4-20-20-20-96 ReLU, B 128.
// Facts:   with all forces zero and no coupling, q oscillates with period 2 pi.
//          The notebook reports the loss of the training data, HIG's scripts
//          that of test data; both are sum |r|^2 / N.
// Source:  PBDL, chapter physgrad-hig-code, arXiv 2109.05237; Schnell, Holl,
//          Thuerey, ICLR 2022, section 3.2, arXiv 2203.10131, and its code,
//          Nonlinear_oscillators/.
#ifndef PROBLEMS_OSCILLATOR_CHAIN_H_
#define PROBLEMS_OSCILLATOR_CHAIN_H_

#include <string>

#include "invgrad/compare/problem.h"

namespace invgrad {

// The maximal length of the chain.
constexpr int kMaxOscillators = 16;

// One Runge-Kutta step: state (q, v), control u -> next state. kNumOscillators:
// num_oscillators at compile time, to unroll loops, or 0.
template <int kNumOscillators>
struct OscillatorStep {
  static constexpr int kCapacity =
      kNumOscillators > 0 ? kNumOscillators : kMaxOscillators;

  int num_oscillators = 2;
  double dt = 0.5;
  double linear = 0.2;
  double cubic = 0.0;
  double control = 1.0;

  template <typename T>
  bool operator()(const T* state, const T* u, T* next_state) const {
    const int size = 2 * count();
    T k1[2 * kCapacity] = {}, k2[2 * kCapacity] = {}, k3[2 * kCapacity] = {};
    T k4[2 * kCapacity] = {}, stage[2 * kCapacity] = {};
    Derivative(state, *u, k1);
    for (int i = 0; i < size; ++i) stage[i] = state[i] + (0.5 * dt) * k1[i];
    Derivative(stage, *u, k2);
    for (int i = 0; i < size; ++i) stage[i] = state[i] + (0.5 * dt) * k2[i];
    Derivative(stage, *u, k3);
    for (int i = 0; i < size; ++i) stage[i] = state[i] + dt * k3[i];
    Derivative(stage, *u, k4);
    for (int i = 0; i < size; ++i) {
      next_state[i] =
          state[i] + (dt / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
    return true;
  }

  // d(q, v)/dt.
  template <typename T>
  void Derivative(const T* state, const T& u, T* derivative) const {
    const T* q = state;
    const T* v = state + count();
    T* acceleration = derivative + count();
    for (int i = 0; i < count(); ++i) {
      derivative[i] = v[i];
      acceleration[i] = -q[i];
    }
    for (int i = 0; i + 1 < count(); ++i) {
      const T gap = q[i + 1] - q[i];
      const T force = linear * gap + cubic * (gap * gap * gap);
      acceleration[i] += force;
      acceleration[i + 1] -= force;
    }
    acceleration[count() - 1] += control * u;
  }

  int count() const {
    return kNumOscillators > 0 ? kNumOscillators : num_oscillators;
  }
};

struct OscillatorChain {
  std::string coupling = "linear";
  int num_oscillators = 2;
  int num_steps = 0;
  int num_samples = 4096;
  int data_seed = 0;
  double noise = 0.0;
  void Describe(OptionSet* set);
  bool Create(LearningProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_OSCILLATOR_CHAIN_H_
