// A simulator that steps a state through time with an output at every step: y
// holds the terms of a loss that is a sum over time.
//
//   s_{t+1} = step(s_t, u_t),   z_t = output(t, s_{t+1}, u_t),   s_0 = c
//   y = (z_0, .., z_{N-1}),     t = 0 .. N-1
//
// With z_t = (sqrt(q_t) (s_{t+1} - s*), sqrt(rho) u_t) and y* = 0, say, a
// squared norm of y - y* is sum_t q_t |s_{t+1} - s*|^2 + rho |u_t|^2, where the
// last q_t may be a terminal weight: a least-squares problem, for every rule
// and for Ceres' trust regions. output = s_{t+1} gives the trajectory.
//
// It is also its own feedback: a network may compute u_t from s_t (feedback.h).
//
// Shapes:  s, c: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc;  z: no;  y: N no.
//   template <typename T>   // step
//   bool operator()(const T* state, const T* control, T* next_state) const;
//   template <typename T>   // output
//   bool operator()(int t, const T* next_state, const T* control,
//                   T* output) const;
// Cost:    J and adjoint: N ceil((ns + nc) / kStride) evaluations of `step` and
//          `output` with Jets of kStride partial derivatives. Hessian: about
//          half the square of this number a step, with nested Jets of
//          kStride^2. For the chaining see stepped_simulator.h.
// Fails:   returns false if `step` or `output` returns false or a value is not
//          finite.
#ifndef INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
#define INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_

#include <algorithm>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/chain/stepped_simulator.h"
#include "invgrad/core/nested_jet.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename StepFunctor, typename Output, int kStride = 4>
class TrajectorySimulator : public SteppedSimulator {
 public:
  // With output_size = 0, y = s_N.
  TrajectorySimulator(StepFunctor step,
                      Output output,
                      int state_size,
                      int control_size,
                      int output_size,
                      int num_steps)
      : SteppedSimulator(state_size, control_size, output_size, num_steps),
        step_(std::move(step)),
        output_(std::move(output)) {}

 private:
  bool Step(Index t,
            const double* state,
            const double* control,
            Index rows,
            double* next) const override {
    return Call(t, state, control, rows, next);
  }

  bool LinearizeStep(Index t,
                     const double* state,
                     const double* control,
                     Index rows,
                     double* next,
                     double* G_t) const override {
    using Jet = ceres::Jet<double, kStride>;
    const Index ns = state_size();
    const Index size = ns + control_size();
    Scratch<Jet> jets(size + rows);
    Jet* const z = jets.data();  // state and control
    Jet* const next_jets = z + size;
    for (Index i = 0; i < ns; ++i) z[i] = Jet(state[i]);
    for (Index i = ns; i < size; ++i) z[i] = Jet(control[i - ns]);
    for (Index first = 0; first < size; first += kStride) {
      const Index width = std::min<Index>(kStride, size - first);
      for (Index k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
      if (!Inlined(t, z, z + ns, rows, next_jets)) return false;
      for (Index k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
      for (Index i = 0; i < rows; ++i) {
        std::copy_n(next_jets[i].v.data(), width, G_t + i * size + first);
      }
    }
    for (Index i = 0; i < rows; ++i) next[i] = next_jets[i].a;
    return true;
  }

  // In blocks of kStride.
  bool StepHessian(Index t,
                   const double* state,
                   const double* control,
                   const Eigen::VectorXd& covector,
                   Eigen::MatrixXd* hessian) const override {
    using Jet = NestedJet<kStride>;
    using Inner = InnerJet<kStride>;
    const Index ns = state_size();
    const Index size = ns + control_size();
    Scratch<Jet> z(size);
    Scratch<Jet> next(covector.size());
    for (Index row = 0; row < size; row += kStride) {
      for (Index col = 0; col <= row; col += kStride) {
        for (Index i = 0; i < size; ++i) {
          z[i] = Jet(Inner(i < ns ? state[i] : control[i - ns]));
          if (i >= row && i < row + kStride) z[i].v[i - row] = Inner(1.0);
          if (i >= col && i < col + kStride) z[i].a.v[i - col] = 1.0;
        }
        if (!Call(t, z.data(), z.data() + ns, covector.size(), next.data())) {
          return false;
        }
        const Index num_rows = std::min<Index>(kStride, size - row);
        const Index num_cols = std::min<Index>(kStride, size - col);
        for (Index j = 0; j < num_rows; ++j) {
          for (Index k = 0; k < num_cols; ++k) {
            double sum = 0.0;
            for (Index i = 0; i < covector.size(); ++i) {
              sum += covector[i] * next[i].v[j].v[k];
            }
            (*hessian)(row + j, col + k) = sum;
            (*hessian)(col + k, row + j) = sum;
          }
        }
      }
    }
    return true;
  }

  template <typename T>
  bool Call(
      Index t, const T* state, const T* control, Index rows, T* next) const {
    const Index ns = state_size();
    return step_(state, control, next) &&
           (rows == ns ||
            output_(static_cast<int>(t), next, control, next + ns));
  }

  // In steps of more than a few dozen operations GCC stops inlining the
  // operators of Jets; this makes a Runge-Kutta step three times slower (GCC
  // 12, -O3).
  template <typename T>
  [[gnu::flatten]] bool Inlined(
      Index t, const T* state, const T* control, Index rows, T* next) const {
    return Call(t, state, control, rows, next);
  }

  StepFunctor step_;
  Output output_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
