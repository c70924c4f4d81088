// A chain of coupled oscillators whose last mass must follow a reference. The
// network chooses the force at every step: closed-loop control.
//
//   q' = v,   v' = the chain of oscillator_chain.h with the force u(t)
//   p(t) = a_1 + a_2,   a_i' = omega_i b_i,   b_i' = -omega_i a_i
//   s = (q, v, a_1, b_1, a_2, b_2),   u_t = f(s_t; theta),   t = 0 .. T-1
//   L = dt sum_t [weight_t (q_last(t+1) - p(t+1))^2 + control_weight u_t^2]
//
// weight_t is 1, and end_weight at the last step. The reference p is a mixture
// of two sinusoids, whose amplitudes and phases differ from sample to sample.
// The state includes the state of the reference's generator, so the network can
// anticipate the reference: a full-information regulator [1].
//
// Discretization: T = horizon steps of dt, u constant in a step; classical
//          Runge-Kutta (order 4) for the chain, the exact rotation for (a, b).
// Shapes:  state, network input: 2 num_oscillators + 4;  x = (u_0, ..): T;
//          y, of which L is the squared norm: 2 T, at each step the weighted
//          error and force.
// Data:    np.random.seed(data_seed); np.random.uniform(-1, 1, (2 N,
//          2 num_oscillators + 4)), the states at the start, the first N rows
//          for training, the others for testing.
// Metric:  with coupling=linear, regret: the mean L minus its minimum over all
//          forces. The last mass does not start on the reference, so this
//          minimum (0.4 by default) hides the differences between controllers.
// Facts:   coupling=linear is a linear-quadratic problem. The minimum is
//          s_0^T Pi_0 s_0 with the Riccati recursion
//            Pi_T = 0,   K_t = (R + B^T W B)^-1 B^T W A,   W = Pi_{t+1} + Q_t,
//            Pi_t = A^T W A - K_t^T (R + B^T W B) K_t
//          for s_{t+1} = A s_t + B u_t and L = sum_t s_{t+1}^T Q_t s_{t+1} +
//          R u_t^2. The best feedback, u_t = -K_t s_t, is linear in s but
//          differs from step to step towards the end of the horizon. Any other
//          force costs sum_t (R + B^T W B) (u_t + K_t s_t)^2 more: the regret,
//          at O(T) a sample.
// Source:  none for the setting; for the chain see oscillator_chain.h.
//
// [1] Francis. The linear multivariable regulator problem. SIAM Journal on
//     Control and Optimization 15 (1977).
#ifndef PROBLEMS_OSCILLATOR_TRACKING_H_
#define PROBLEMS_OSCILLATOR_TRACKING_H_

#include <string>

#include "problems/problem.h"

namespace invgrad {

// `data`: states at the start, one a row.
struct OscillatorTracking {
  // omega_1 and omega_2: below and above the chain's own frequencies, 1 for the
  // masses in phase and 1.18 against each other (two linear oscillators).
  static constexpr double kFrequencies[2] = {0.5, 1.5};

  std::string coupling = "linear";
  int num_oscillators = 2;
  int horizon = 24;
  double dt = 0.25;
  double control_weight = 0.01;
  double end_weight = 1.0;
  int num_samples = 1024;
  int data_seed = 0;
  void Describe(OptionSet* set);
  bool Create(LearningProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_OSCILLATOR_TRACKING_H_
