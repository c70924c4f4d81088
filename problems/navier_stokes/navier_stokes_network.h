// The learning problem `navier_stokes`: a network finds the velocity that moves
// a blob of marker to where it is seen later.
//
//   x = f(m_0, y*),   y = P(x; m_0) (navier_stokes.h),   L = CoarseShapeLoss
//
// Shapes:  network input (m_0, y*): 2 n^2; x: 2 n^2; y, the context m_0: n^2;
//          n = resolution.
// Inverse: time_reversal.h: one number a sample. It aims at the marker y*, so
//          the way through the loss is `target`, and SIP is target/inverse/adam:
//          H_L is singular and too large to invert.
// Metric:  velocity_error = MeanVelocityError. The fluctuations of x* do not
//          show in y*: their length, 0.125, is its floor.
// Data:    RandomNavierStokesFields, one batch of 2 num_samples for training and
//          testing; with fresh_data one batch a step. The array `data` has a
//          row (m_0, x*) a sample: 3 n^2.
// Settings: published are a U-net of 5 levels (49,570 weights) at n = 64, new
//          samples at every step, B 64, Adam with step size 5e-3, 20,000 steps;
//          beside SIP, Adam on the loss, "GD accumulate", which is
//          gradient/gradient_descent/adam:inner_step_size=0.04:inner_rescale=true
//          with 8 inner steps, and L-BFGS with 16 iterations,
//          gradient/lbfgs/adam. By default a dense network with ReLU,
//          2 n^2-128-128-2 n^2, at n = 16. `reversal`: the release's factors of
//          the swirl's way look like a slip (time_reversal.h), and find the swirl
//          in fewer steps than straight ones (docs/results/fields.md).
// Facts:   L = n^2 sqrt(1e-5) for a perfect match. x = 0 has a velocity_error of
//          about 11 (64 samples, n = 64).
// Source:  as navier_stokes.h.
#ifndef PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_NETWORK_H_
#define PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_NETWORK_H_

#include <string>

#include "invgrad/compare/problem.h"
#include "invgrad/compare/sample_data.h"
#include "problems/field_data.h"

namespace invgrad {

struct NavierStokesNetwork {
  int resolution = 16;
  int num_samples = 256;
  int data_seed = 0;
  std::string reversal = "released";
  FieldNetwork field;
  NavierStokesNetwork() { field.u_net.levels = 5; }
  void Describe(OptionSet* set) {
    set->Add("resolution", &resolution, {8, 256}, "cells a side, n");
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
    set->Add("reversal",
             &reversal,
             {"straight", "released"},
             "the swirl's way in the inverse (time_reversal.h)");
    field.Describe(set);
  }

  bool Create(LearningProblem* problem, std::string* error) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_NAVIER_STOKES_NAVIER_STOKES_NETWORK_H_
