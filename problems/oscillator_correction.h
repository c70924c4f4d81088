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

#include <string>

#include "problems/problem.h"

namespace invgrad {

// `data`: states at the start, one a row.
struct OscillatorCorrection {
  int num_oscillators = 2;
  int horizon = 16;
  double dt = 0.25;
  int num_samples = 1024;
  int data_seed = 0;
  void Describe(OptionSet* set);
  bool Create(LearningProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_OSCILLATOR_CORRECTION_H_
