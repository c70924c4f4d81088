// A roll-out through time and its derivatives, a step at a time: what the
// simulators that step through time have in common.
//
//   (s_{t+1}, z_t) = map(t, s_t, u_t),   t = 0 .. N-1
//
// Jets never see more than one step; the steps' Jacobians and Hessians are
// chained backwards [1]. With G_t the Jacobian of the map in (s_t, u_t), its
// first rows M_t = [A_t B_t] = ds_{t+1}/d(s_t, u_t), and covectors w_t of z_t
// and p of s_N:
//
//   pull-back  for t = N-1 .. 0:   [p; x_bar_t] = G_t^T [p; w_t]
//   Hessian    of F = p . s_N + sum_t w_t . z_t in x. Before step t let
//              p, P = dF/ds, d2F/ds2 and R = the mixed derivatives with respect
//              to s and all later controls. With Q_t the Hessian of
//              [p; w_t] . map in (s_t, u_t), by nested Jets:
//                S = Q_t + M_t^T P M_t:   P = S_ss, R_t = S_su, H_tt = S_uu
//                later controls k > t:    [R_k; H_tk] = M_t^T R_k
//
// Shapes:  s: ns;  u: nc;  z: no, perhaps 0;  x = u_0 .. u_{N-1}: N nc;
//          z_0 .. z_{N-1}: N no.
//   template <typename T>
//   bool operator()(Index t, const T* state, const T* control,
//                   T* next_state_and_output) const;
// Cost:    G: ceil((ns + nc) / kStride) evaluations of the map a step of time,
//          with Jets of kStride partial derivatives. Hessian: about half the
//          square of that many, with kStride^2; chaining takes
//          N^2 nc ns (ns + nc).
// Fails:   returns false if the map does or a value is not finite.
//
// [1] Griewank, Walther. Evaluating Derivatives. 2nd edition, SIAM 2008,
//     chapter 3: forward mode inside a step, reverse mode over the steps.
#ifndef INVGRAD_CHAIN_ROLL_OUT_H_
#define INVGRAD_CHAIN_ROLL_OUT_H_

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "glog/logging.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/nested_jet.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename Map, int kStride>
class RollOut {
 public:
  using Index = Eigen::Index;

  RollOut(
      Map map, int state_size, int control_size, int output_size, int num_steps)
      : map_(std::move(map)),
        state_size_(state_size),
        control_size_(control_size),
        output_size_(output_size),
        num_steps_(num_steps) {
    CHECK_GT(state_size, 0);
    CHECK_GT(control_size, 0);
    CHECK_GE(output_size, 0);
    CHECK_GT(num_steps, 0);
  }

  const Map& map() const { return map_; }
  Index state_size() const { return state_size_; }      // ns
  Index control_size() const { return control_size_; }  // nc
  Index output_size() const { return output_size_; }    // no
  Index num_steps() const { return num_steps_; }        // N
  Index num_controls() const { return num_steps_ * control_size_; }
  Index num_outputs() const { return num_steps_ * output_size_; }
  // Entries of G_t.
  Index JacobianSize() const {
    return (state_size_ + output_size_) * (state_size_ + control_size_);
  }

  // Computes s_N and, if there are any, the outputs.
  bool Run(const double* x,
           const double* start,
           double* state,
           double* outputs) const {
    Scratch<double> next(state_size_ + output_size_);
    std::copy_n(start, state_size_, state);
    for (Index t = 0; t < num_steps_; ++t) {
      if (!map_(t, state, x + t * control_size_, next.data())) return false;
      std::copy_n(next.data(), state_size_, state);
      std::copy_n(
          next.data() + state_size_, output_size_, outputs + t * output_size_);
    }
    return AllFinite(state, state_size_) && AllFinite(outputs, num_outputs());
  }

  // Which step is to blame where Run, Linearize or WeightedHessian have failed
  // or what was chained from G is not finite: Simulator::DescribeFailure.
  std::string DescribeFailure(const double* x, const double* start) const {
    Scratch<double> state(state_size_);
    Scratch<double> next(state_size_ + output_size_);
    std::copy_n(start, state_size_, state.data());
    for (Index t = 0; t < num_steps_; ++t) {
      if (!map_(t, state.data(), x + t * control_size_, next.data())) {
        return AtTimeStep("the step has no value at", t, num_steps_);
      }
      if (!AllFinite(next.data(), state_size_)) {
        return AtTimeStep("the state is not finite after", t, num_steps_);
      }
      if (!AllFinite(next.data() + state_size_, output_size_)) {
        return AtTimeStep("the output is not finite at", t, num_steps_);
      }
      std::copy_n(next.data(), state_size_, state.data());
    }
    Scratch<double> outputs(num_outputs());
    Scratch<double> G(num_steps_ * JacobianSize());
    std::fill_n(G.data(),
                num_steps_ * JacobianSize(),
                std::numeric_limits<double>::quiet_NaN());
    Linearize(x, start, state.data(), outputs.data(), nullptr, G.data());
    for (Index t = 0; t < num_steps_; ++t) {
      if (!AllFinite(G.data() + t * JacobianSize(), JacobianSize())) {
        return AtTimeStep("its derivative is not finite at", t, num_steps_);
      }
    }
    return "its derivatives are finite at every time step, and not over all " +
           std::to_string(num_steps_);
  }

  // Runs, keeping G_t of every step, row-major, and the states before the steps
  // unless `states` is null.
  bool Linearize(const double* x,
                 const double* start,
                 double* state,
                 double* outputs,
                 double* states,
                 double* G) const {
    using Jet = ceres::Jet<double, kStride>;
    const Index ns = state_size_;
    const Index size = ns + control_size_;
    const Index num_rows = ns + output_size_;
    Scratch<Jet> z(size);  // state and control
    Scratch<Jet> next(num_rows);
    std::copy_n(start, ns, state);
    for (Index t = 0; t < num_steps_; ++t) {
      const double* control = x + t * control_size_;
      double* G_t = G + t * JacobianSize();
      if (states != nullptr) std::copy_n(state, ns, states + t * ns);
      for (Index i = 0; i < ns; ++i) z[i] = Jet(state[i]);
      for (Index i = ns; i < size; ++i) z[i] = Jet(control[i - ns]);
      for (Index first = 0; first < size; first += kStride) {
        const Index width = std::min<Index>(kStride, size - first);
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
        if (!InlinedMap(t, z.data(), z.data() + ns, next.data())) return false;
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
        for (Index i = 0; i < num_rows; ++i) {
          std::copy_n(next[i].v.data(), width, G_t + i * size + first);
        }
      }
      for (Index i = 0; i < ns; ++i) state[i] = next[i].a;
      for (Index i = ns; i < num_rows; ++i) {
        outputs[t * output_size_ + i - ns] = next[i].a;
      }
    }
    return AllFinite(state, ns) && AllFinite(outputs, num_outputs()) &&
           AllFinite(G, num_steps_ * JacobianSize());
  }

  // Replaces p by the covector of s_0 and computes that of x. w is not read if
  // there are no outputs.
  void PullBack(const double* G,
                const double* w,
                double* p,
                double* x_bar) const {
    Scratch<double> covector(state_size_ + output_size_);  // [p; w_t]
    Scratch<double> pulled(state_size_ + control_size_);
    for (Index t = num_steps_ - 1; t >= 0; --t) {
      StackCovectors(t, p, w, covector.data());
      TransposeTimes(G + t * JacobianSize(), covector.data(), pulled.data());
      std::copy_n(pulled.data(), state_size_, p);
      std::copy_n(pulled.data() + state_size_,
                  control_size_,
                  x_bar + t * control_size_);
    }
  }

  // Computes H (N nc x N nc), symmetric to the bit, for the covectors p of s_N
  // and w of the outputs.
  bool WeightedHessian(const double* x,
                       const double* start,
                       const double* w,
                       Eigen::VectorXd p,
                       double* hessian) const {
    const Index ns = state_size_;
    const Index nc = control_size_;
    Scratch<double> state(ns);
    Scratch<double> outputs(num_outputs());
    Scratch<double> states(num_steps_ * ns);
    Scratch<double> G(num_steps_ * JacobianSize());
    if (!Linearize(
            x, start, state.data(), outputs.data(), states.data(), G.data())) {
      return false;
    }
    Eigen::VectorXd covector(ns + output_size_);  // [p; w_t]
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(ns, ns);
    Eigen::MatrixXd R(ns, num_controls());
    Eigen::MatrixXd S(ns + nc, ns + nc);
    Eigen::MatrixXd chained;  // M_t^T R of the later controls
    Eigen::Map<Eigen::MatrixXd> H(hessian, num_controls(), num_controls());
    for (Index t = num_steps_ - 1; t >= 0; --t) {
      const ConstRowMajorMap G_t(
          G.data() + t * JacobianSize(), ns + output_size_, ns + nc);
      const auto M_t = G_t.topRows(ns);
      StackCovectors(t, p.data(), w, covector.data());
      if (!MapHessian(t, &states[t * ns], x + t * nc, covector, &S)) {
        return false;
      }
      S.noalias() += M_t.transpose() * P * M_t;
      S.triangularView<Eigen::StrictlyUpper>() = S.transpose();  // to the bit
      const Index column = t * nc;
      const Index first_later = column + nc;
      const Index num_later = num_controls() - first_later;
      chained.noalias() = M_t.transpose() * R.rightCols(num_later);
      R.rightCols(num_later) = chained.topRows(ns);
      R.middleCols(column, nc) = S.topRightCorner(ns, nc);
      H.block(column, first_later, nc, num_later) = chained.bottomRows(nc);
      H.block(first_later, column, num_later, nc) =
          chained.bottomRows(nc).transpose();
      H.block(column, column, nc, nc) = S.bottomRightCorner(nc, nc);
      P = S.topLeftCorner(ns, ns);
      p = G_t.leftCols(ns).transpose() * covector;
    }
    return AllFinite(hessian, H.size());
  }

  // G_t^T [p; w_t], as sums in registers: the sizes are too small for anything
  // else.
  void TransposeTimes(const double* G_t,
                      const double* covector,
                      double* pulled) const {
    const Index size = state_size_ + control_size_;
    const Index num_rows = state_size_ + output_size_;
    for (Index k = 0; k < size; ++k) {
      double sum = 0.0;
      for (Index i = 0; i < num_rows; ++i)
        sum += G_t[i * size + k] * covector[i];
      pulled[k] = sum;
    }
  }

 private:
  using ConstRowMajorMap = Eigen::Map<
      const Eigen::
          Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

  void StackCovectors(Index t,
                      const double* p,
                      const double* w,
                      double* covector) const {
    std::copy_n(p, state_size_, covector);
    std::copy_n(w + t * output_size_, output_size_, covector + state_size_);
  }

  // GCC stops inlining the Jets' operators in a step of more than a few dozen
  // operations; a Runge-Kutta step is then three times slower (GCC 12, -O3).
  template <typename T>
  [[gnu::flatten]] bool InlinedMap(Index t,
                                   const T* state,
                                   const T* control,
                                   T* next) const {
    return map_(t, state, control, next);
  }

  // The Hessian of covector . map in state and control, in blocks of kStride.
  bool MapHessian(Index t,
                  const double* state,
                  const double* control,
                  const Eigen::VectorXd& covector,
                  Eigen::MatrixXd* hessian) const {
    using Jet = NestedJet<kStride>;
    using Inner = InnerJet<kStride>;
    const Index ns = state_size_;
    const Index size = ns + control_size_;
    Scratch<Jet> z(size);
    Scratch<Jet> next(covector.size());
    for (Index row = 0; row < size; row += kStride) {
      for (Index col = 0; col <= row; col += kStride) {
        for (Index i = 0; i < size; ++i) {
          z[i] = Jet(Inner(i < ns ? state[i] : control[i - ns]));
          if (i >= row && i < row + kStride) z[i].v[i - row] = Inner(1.0);
          if (i >= col && i < col + kStride) z[i].a.v[i - col] = 1.0;
        }
        if (!map_(t, z.data(), z.data() + ns, next.data())) return false;
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

  Map map_;
  Index state_size_;
  Index control_size_;
  Index output_size_;
  Index num_steps_;
};

// The map of a step without outputs.
template <typename Step>
struct StepMap {
  Step step;
  template <typename T>
  bool operator()(Eigen::Index /*t*/,
                  const T* state,
                  const T* control,
                  T* next_state) const {
    return step(state, control, next_state);
  }
};

// The map of a step whose output is the next state.
template <typename Step>
struct StateMap {
  Step step;
  int state_size;
  template <typename T>
  bool operator()(Eigen::Index /*t*/,
                  const T* state,
                  const T* control,
                  T* next_state_twice) const {
    if (!step(state, control, next_state_twice)) return false;
    std::copy_n(next_state_twice, state_size, next_state_twice + state_size);
    return true;
  }
};

// Feedback::StateHessian of a simulator that makes this step.
template <int kStride, typename Step>
bool RollOutStateHessian(const Step& step,
                         int state_size,
                         int control_size,
                         int num_steps,
                         const double* x,
                         const double* start,
                         const double* w,
                         double* hessian) {
  const RollOut<StateMap<Step>, kStride> states(
      {step, state_size}, state_size, control_size, state_size, num_steps);
  return states.WeightedHessian(
      x, start, w, Eigen::VectorXd::Zero(state_size), hessian);
}

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_ROLL_OUT_H_
