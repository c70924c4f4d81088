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
//          Batches: four samples at once, by a T of four doubles (lanes.h),
//          unless a functor has kInLanes = false; samples between which a branch
//          on values differs are repeated one at a time.
// Fails:   returns false if `step` or `output` returns false or a value is not
//          finite.
#ifndef INVGRAD_INTERNAL_TRAJECTORY_SIMULATOR_H_
#define INVGRAD_INTERNAL_TRAJECTORY_SIMULATOR_H_

#include <algorithm>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/internal/lanes.h"
#include "invgrad/internal/nested_jet.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/internal/stepped_simulator.h"

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

  std::string WhyNoLanes() const override {
    return kHasLanes ? "" : kLanesDeclined;
  }

 private:
  static constexpr bool kHasLanes =
      WantsLanes<StepFunctor>::value && WantsLanes<Output>::value;

  bool Steps(Index begin,
             Index end,
             const double* x,
             Index rows,
             double* state,
             double* states,
             double* outputs,
             double* G) const override {
    return StepsOf(begin, end, x, rows, state, states, outputs, G);
  }
  bool Steps([[maybe_unused]] Index begin,
             [[maybe_unused]] Index end,
             [[maybe_unused]] const Pack* x,
             [[maybe_unused]] Index rows,
             [[maybe_unused]] Pack* state,
             [[maybe_unused]] Pack* states,
             [[maybe_unused]] Pack* outputs,
             [[maybe_unused]] Pack* G) const override {
    if constexpr (kHasLanes) {
      return StepsOf(begin, end, x, rows, state, states, outputs, G);
    } else {
      return false;
    }
  }

  template <typename T>
  bool StepsOf(Index begin,
               Index end,
               const T* x,
               Index rows,
               T* state,
               T* states,
               T* outputs,
               T* G) const {
    using Jet = ceres::Jet<T, kStride>;
    const Index ns = state_size();
    const Index nc = control_size();
    const Index no = rows - ns;
    const Index size = ns + nc;
    Scratch<T> next(G == nullptr ? rows : 0);
    Scratch<Jet> jets(G == nullptr ? 0 : size + rows);
    T* const next_values = next.data();
    Jet* const z = jets.data();  // state and control
    Jet* const next_jets = z + size;
    // *next = (s_{t+1}, z_t).
    const auto store = [=](Index t, const auto& next) {
      for (Index i = 0; i < ns; ++i) state[i] = next(i);
      for (Index i = 0; i < no; ++i) outputs[t * no + i] = next(ns + i);
    };
    const auto step = [=](Index t) {
      if (!Call(t, state, x + t * nc, rows, next_values)) return false;
      store(t, [=](Index i) { return next_values[i]; });
      return true;
    };
    const auto linearize = [=](Index t) {
      T* const G_t = G + t * rows * size;
      for (Index i = 0; i < ns; ++i) z[i].a = state[i];
      for (Index i = ns; i < size; ++i) z[i].a = x[t * nc + i - ns];
      for (Index first = 0; first < size; first += kStride) {
        const Index width = std::min<Index>(kStride, size - first);
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
        if (!Call(t, z, z + ns, rows, next_jets)) return false;
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
        for (Index i = 0; i < rows; ++i) {
          std::copy_n(next_jets[i].v.data(), width, G_t + i * size + first);
        }
      }
      store(t, [=](Index i) { return next_jets[i].a; });
      return true;
    };
    return CallInlinedFor<T>([=] {
      if (G != nullptr) std::fill_n(z, size, Jet());
      for (Index t = begin; t < end; ++t) {
        if (states != nullptr) std::copy_n(state, ns, states + t * ns);
        if (!(G == nullptr ? step(t) : linearize(t))) return false;
      }
      return true;
    });
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

  StepFunctor step_;
  Output output_;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_TRAJECTORY_SIMULATOR_H_
