// A time step given by a functor on a scalar type, differentiated by Jets.
//
//   template <typename T>
//   bool operator()(Index t, const T* state, const T* control,
//                   T* next_state_and_output) const;
//
// Cost:    G_t: ceil((ns + nc) / kStride) evaluations of the functor with Jets
//          of kStride partial derivatives. Hessian: about half the square of
//          this number, with nested Jets of kStride^2.
// Fails:   returns false if the functor does.
#ifndef INVGRAD_CHAIN_AUTODIFF_STEP_H_
#define INVGRAD_CHAIN_AUTODIFF_STEP_H_

#include <algorithm>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/chain/roll_out.h"
#include "invgrad/core/nested_jet.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

// Without the Hessian, because nested Jets double the compile time.
template <typename Functor, int kStride>
class FirstOrderStep : public TimeStep {
 public:
  FirstOrderStep(Functor functor,
                 int state_size,
                 int control_size,
                 int output_size)
      : TimeStep(state_size, control_size, output_size),
        functor_(std::move(functor)) {}

  bool Evaluate(Index t,
                const double* state,
                const double* control,
                double* next) const override {
    return functor_(t, state, control, next);
  }

  bool Linearize(Index t,
                 const double* state,
                 const double* control,
                 double* next,
                 double* G_t) const override {
    using Jet = ceres::Jet<double, kStride>;
    const Index ns = state_size();
    const Index size = ns + control_size();
    const Index num_rows = ns + output_size();
    Scratch<Jet> jets(size + num_rows);
    Jet* const z = jets.data();  // state and control
    Jet* const next_jets = z + size;
    for (Index i = 0; i < ns; ++i) z[i] = Jet(state[i]);
    for (Index i = ns; i < size; ++i) z[i] = Jet(control[i - ns]);
    for (Index first = 0; first < size; first += kStride) {
      const Index width = std::min<Index>(kStride, size - first);
      for (Index k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
      if (!Inlined(t, z, z + ns, next_jets)) return false;
      for (Index k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
      for (Index i = 0; i < num_rows; ++i) {
        std::copy_n(next_jets[i].v.data(), width, G_t + i * size + first);
      }
    }
    for (Index i = 0; i < num_rows; ++i) next[i] = next_jets[i].a;
    return true;
  }

 protected:
  const Functor& functor() const { return functor_; }

 private:
  // In steps of more than a few dozen operations GCC stops inlining the
  // operators of Jets; this makes a Runge-Kutta step three times slower (GCC
  // 12, -O3).
  template <typename T>
  [[gnu::flatten]] bool Inlined(Index t,
                                const T* state,
                                const T* control,
                                T* next) const {
    return functor_(t, state, control, next);
  }

  Functor functor_;
};

template <typename Functor, int kStride>
class AutoDiffStep final : public FirstOrderStep<Functor, kStride> {
 public:
  using Index = Eigen::Index;
  using FirstOrderStep<Functor, kStride>::FirstOrderStep;

  // In blocks of kStride.
  bool WeightedHessian(Index t,
                       const double* state,
                       const double* control,
                       const Eigen::VectorXd& covector,
                       Eigen::MatrixXd* hessian) const override {
    using Jet = NestedJet<kStride>;
    using Inner = InnerJet<kStride>;
    const Index ns = this->state_size();
    const Index size = ns + this->control_size();
    Scratch<Jet> z(size);
    Scratch<Jet> next(covector.size());
    for (Index row = 0; row < size; row += kStride) {
      for (Index col = 0; col <= row; col += kStride) {
        for (Index i = 0; i < size; ++i) {
          z[i] = Jet(Inner(i < ns ? state[i] : control[i - ns]));
          if (i >= row && i < row + kStride) z[i].v[i - row] = Inner(1.0);
          if (i >= col && i < col + kStride) z[i].a.v[i - col] = 1.0;
        }
        if (!this->functor()(t, z.data(), z.data() + ns, next.data()))
          return false;
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
};

// The functor of a step without outputs: step(state, control, next_state).
template <typename Step>
struct StepWithoutOutput {
  Step step;
  template <typename T>
  bool operator()(Eigen::Index /*t*/,
                  const T* state,
                  const T* control,
                  T* next_state) const {
    return step(state, control, next_state);
  }
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_AUTODIFF_STEP_H_
