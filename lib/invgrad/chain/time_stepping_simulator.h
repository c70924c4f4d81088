// A simulator that steps a state through time under controls.
//
//   s_{t+1} = step(s_t, u_t),   t = 0 .. N-1,   s_0 = c,   y = s_N
//
// It is differentiated a step at a time and chained backwards, so that Jets
// never see more than one step [1]. With A_t = ds_{t+1}/ds_t, B_t =
// ds_{t+1}/du_t:
//
//   Jacobian   C = I;     for t = N-1 .. 0:   J_t = C B_t,       C = C A_t
//   pull-back  p = w(y);  for t = N-1 .. 0:   x_bar_t = B_t^T p, p = A_t^T p
//   Hessian    of w . y. Before step t let p, P = d2(w.y)/ds2 and R = the mixed
//              derivatives with respect to s and all later controls. With Q_t
//              the Hessian of p . step in (s_t, u_t), by nested Jets, and
//              M_t = [A_t B_t]:
//                S = Q_t + M_t^T P M_t:   P = S_ss, R_t = S_su, H_tt = S_uu
//                later controls k > t:    [R_k; H_tk] = M_t^T R_k
//
// Shapes:  s, c, y: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc.
//   template <typename T>
//   bool operator()(const T* state, const T* control, T* next_state) const;
// Cost:    J, pull-back: ceil((ns + nc) / kStride) evaluations of `step` a step
//          of time, with Jets of kStride partial derivatives; chaining J takes
//          2 ns^2 (ns + nc) N. Hessian: about half the square of that many,
//          with kStride^2; chaining takes N^2 nc ns (ns + nc).
// Fails:   returns false if `step` does or a value is not finite.
//
// [1] Griewank, Walther. Evaluating Derivatives. 2nd edition, SIAM 2008,
//     chapter 3: forward mode inside a step, reverse mode over the steps.
#ifndef INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
#define INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_

#include <algorithm>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "glog/logging.h"
#include "invgrad/chain/nested_jet.h"
#include "invgrad/chain/scratch.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/linalg/blas.h"

namespace invgrad {

template <typename Step, int kStride = 4>
class TimeSteppingSimulator final : public Simulator {
 public:
  TimeSteppingSimulator(Step step,
                        int state_size,
                        int control_size,
                        int num_steps)
      : step_(std::move(step)),
        state_size_(state_size),
        control_size_(control_size),
        num_steps_(num_steps) {
    CHECK_GT(state_size, 0);
    CHECK_GT(control_size, 0);
    CHECK_GT(num_steps, 0);
  }

  int num_inputs() const override {
    return static_cast<int>(num_steps_ * control_size_);
  }
  int num_outputs() const override { return static_cast<int>(state_size_); }
  int num_context() const override { return num_outputs(); }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    if (jacobian == nullptr) return RollOut(x, context, y);
    const Index ns = state_size_;
    const Index size = ns + control_size_;
    Scratch<double> M(num_steps_ * StepJacobianSize());
    if (!LinearizeSteps(x, context, y, nullptr, M.data())) return false;
    // Both by rows: C, and C M_t = [C A_t, C B_t].
    Scratch<double> C(ns * ns);
    Scratch<double> CM(ns * size);
    Eigen::Map<Eigen::MatrixXd>(C.data(), ns, ns).setIdentity();
    for (Index t = num_steps_ - 1; t >= 0; --t) {
      const double* M_t = M.data() + t * StepJacobianSize();
      if (ns < kSmallState) {
        for (Index i = 0; i < ns; ++i) {
          TransposeTimes(M_t, C.data() + i * ns, CM.data() + i * size);
        }
      } else {
        Gemm(Op::kNone,
             Op::kNone,
             1.0,
             Eigen::Map<const Eigen::MatrixXd>(M_t, size, ns),
             Eigen::Map<const Eigen::MatrixXd>(C.data(), ns, ns),
             0.0,
             Eigen::Map<Eigen::MatrixXd>(CM.data(), size, ns));
      }
      for (Index i = 0; i < ns; ++i) {
        const double* row = CM.data() + i * size;
        std::copy(row, row + ns, C.data() + i * ns);
        std::copy(
            row + ns,
            row + size,
            jacobian + i * num_steps_ * control_size_ + t * control_size_);
      }
    }
    return AllFinite(jacobian, ns * num_inputs());
  }

  bool PullBack(const double* x,
                const double* context,
                const Covector& covector,
                double* y,
                double* x_bar) const override {
    Scratch<double> M(num_steps_ * StepJacobianSize());
    if (!LinearizeSteps(x, context, y, nullptr, M.data())) return false;
    Scratch<double> p(state_size_);
    Scratch<double> Mp(state_size_ + control_size_);  // [A_t^T p, B_t^T p]
    if (!covector(y, p.data())) return false;
    for (Index t = num_steps_ - 1; t >= 0; --t) {
      TransposeTimes(M.data() + t * StepJacobianSize(), p.data(), Mp.data());
      std::copy_n(Mp.data(), state_size_, p.data());
      std::copy_n(
          Mp.data() + state_size_, control_size_, x_bar + t * control_size_);
    }
    return AllFinite(x_bar, num_inputs());
  }

  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    const Index ns = state_size_;
    const Index nc = control_size_;
    Scratch<double> y(ns);
    Scratch<double> states(num_steps_ * ns);
    Scratch<double> M(num_steps_ * StepJacobianSize());
    if (!LinearizeSteps(x, context, y.data(), states.data(), M.data())) {
      return false;
    }
    Eigen::VectorXd p = Eigen::Map<const Eigen::VectorXd>(w, ns);
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(ns, ns);
    Eigen::MatrixXd R(ns, num_inputs());
    Eigen::MatrixXd S(ns + nc, ns + nc);
    Eigen::MatrixXd chained;  // M_t^T R of the later controls
    Eigen::Map<Eigen::MatrixXd> H(hessian, num_inputs(), num_inputs());
    for (Index t = num_steps_ - 1; t >= 0; --t) {
      const ConstRowMajorMap M_t(
          M.data() + t * StepJacobianSize(), ns, ns + nc);
      if (!StepHessian(&states[t * ns], x + t * nc, p.data(), &S)) return false;
      S.noalias() += M_t.transpose() * P * M_t;
      S.triangularView<Eigen::StrictlyUpper>() = S.transpose();  // to the bit
      const Index column = t * nc;
      const Index first_later = column + nc;
      const Index num_later = num_inputs() - first_later;
      chained.noalias() = M_t.transpose() * R.rightCols(num_later);
      R.rightCols(num_later) = chained.topRows(ns);
      R.middleCols(column, nc) = S.topRightCorner(ns, nc);
      H.block(column, first_later, nc, num_later) = chained.bottomRows(nc);
      H.block(first_later, column, num_later, nc) =
          chained.bottomRows(nc).transpose();
      H.block(column, column, nc, nc) = S.bottomRightCorner(nc, nc);
      P = S.topLeftCorner(ns, ns);
      p = M_t.leftCols(ns).transpose() * p;
    }
    return AllFinite(hessian, H.size());
  }

 private:
  using Index = Eigen::Index;
  using ConstRowMajorMap = Eigen::Map<
      const Eigen::
          Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

  // Below this state size plain loops beat BLAS: 80 ns against 94 at 6, 183
  // against 108 at 8.
  static constexpr Index kSmallState = 7;

  Index StepJacobianSize() const {
    return state_size_ * (state_size_ + control_size_);
  }

  bool RollOut(const double* x, const double* context, double* y) const {
    Scratch<double> next(state_size_);
    std::copy_n(context, state_size_, y);
    for (Index t = 0; t < num_steps_; ++t) {
      if (!step_(y, x + t * control_size_, next.data())) return false;
      std::copy_n(next.data(), state_size_, y);
    }
    return AllFinite(y, state_size_);
  }

  // Rolls out to y, keeping M_t = [A_t B_t] of every step, row-major, and the
  // states before the steps unless `states` is null.
  bool LinearizeSteps(const double* x,
                      const double* context,
                      double* y,
                      double* states,
                      double* M) const {
    using Jet = ceres::Jet<double, kStride>;
    const Index ns = state_size_;
    const Index size = ns + control_size_;
    Scratch<Jet> z(size);  // state and control
    Scratch<Jet> next(ns);
    std::copy_n(context, ns, y);
    for (Index t = 0; t < num_steps_; ++t) {
      const double* control = x + t * control_size_;
      double* M_t = M + t * StepJacobianSize();
      if (states != nullptr) std::copy_n(y, ns, states + t * ns);
      for (Index i = 0; i < ns; ++i) z[i] = Jet(y[i]);
      for (Index i = ns; i < size; ++i) z[i] = Jet(control[i - ns]);
      for (Index first = 0; first < size; first += kStride) {
        const Index width = std::min<Index>(kStride, size - first);
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
        if (!InlinedStep(z.data(), z.data() + ns, next.data())) return false;
        for (Index k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
        for (Index i = 0; i < ns; ++i) {
          std::copy_n(next[i].v.data(), width, M_t + i * size + first);
        }
      }
      for (Index i = 0; i < ns; ++i) y[i] = next[i].a;
    }
    return AllFinite(y, ns) && AllFinite(M, num_steps_ * StepJacobianSize());
  }

  // GCC stops inlining the Jets' operators in a step of more than a few dozen
  // operations; a Runge-Kutta step is then three times slower (GCC 12, -O3).
  template <typename T>
  [[gnu::flatten]] bool InlinedStep(const T* state,
                                    const T* control,
                                    T* next_state) const {
    return step_(state, control, next_state);
  }

  // M_t^T p, as sums in registers: the sizes are too small for anything else.
  void TransposeTimes(const double* M_t, const double* p, double* Mp) const {
    const Index size = state_size_ + control_size_;
    for (Index k = 0; k < size; ++k) {
      double sum = 0.0;
      for (Index i = 0; i < state_size_; ++i) sum += M_t[i * size + k] * p[i];
      Mp[k] = sum;
    }
  }

  // The Hessian of p . step in state and control, in blocks of kStride.
  bool StepHessian(const double* state,
                   const double* control,
                   const double* p,
                   Eigen::MatrixXd* hessian) const {
    using Jet = NestedJet<kStride>;
    using Inner = InnerJet<kStride>;
    const Index ns = state_size_;
    const Index size = ns + control_size_;
    Scratch<Jet> z(size);
    Scratch<Jet> next(ns);
    for (Index row = 0; row < size; row += kStride) {
      for (Index col = 0; col <= row; col += kStride) {
        for (Index i = 0; i < size; ++i) {
          z[i] = Jet(Inner(i < ns ? state[i] : control[i - ns]));
          if (i >= row && i < row + kStride) z[i].v[i - row] = Inner(1.0);
          if (i >= col && i < col + kStride) z[i].a.v[i - col] = 1.0;
        }
        if (!step_(z.data(), z.data() + ns, next.data())) return false;
        const Index num_rows = std::min<Index>(kStride, size - row);
        const Index num_cols = std::min<Index>(kStride, size - col);
        for (Index j = 0; j < num_rows; ++j) {
          for (Index k = 0; k < num_cols; ++k) {
            double sum = 0.0;
            for (Index i = 0; i < ns; ++i) sum += p[i] * next[i].v[j].v[k];
            (*hessian)(row + j, col + k) = sum;
            (*hessian)(col + k, row + j) = sum;
          }
        }
      }
    }
    return true;
  }

  Step step_;
  Index state_size_;
  Index control_size_;
  Index num_steps_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
