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

  int num_inputs() const override { return num_steps_ * control_size_; }
  int num_outputs() const override { return state_size_; }
  int num_context() const override { return state_size_; }

  const Step& step() const { return step_; }
  int control_size() const { return control_size_; }
  int num_steps() const { return num_steps_; }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    if (jacobian == nullptr) return RollOut(x, context, y);
    const int ns = state_size_;
    const int nc = control_size_;
    Scratch<double> M(num_steps_ * StepJacobianSize());
    if (!LinearizeSteps(x, context, y, nullptr, M.data())) return false;
    Scratch<double> C(ns * ns);
    Scratch<double> CA(ns);  // a row of C A_t
    RowMajorMap(C.data(), ns, ns).setIdentity();
    for (int t = num_steps_ - 1; t >= 0; --t) {
      const double* M_t = M.data() + t * StepJacobianSize();
      for (int row = 0; row < ns; ++row) {
        double* C_row = C.data() + row * ns;
        double* J_row = jacobian + row * num_inputs() + t * nc;
        std::fill_n(CA.data(), ns, 0.0);
        std::fill_n(J_row, nc, 0.0);
        AddTransposeTimes(M_t, C_row, CA.data(), J_row);
        std::copy_n(CA.data(), ns, C_row);
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
    Scratch<double> Ap(state_size_);
    if (!covector(y, p.data())) return false;
    std::fill_n(x_bar, num_inputs(), 0.0);
    for (int t = num_steps_ - 1; t >= 0; --t) {
      std::fill_n(Ap.data(), state_size_, 0.0);
      AddTransposeTimes(M.data() + t * StepJacobianSize(),
                        p.data(),
                        Ap.data(),
                        x_bar + t * control_size_);
      std::copy_n(Ap.data(), state_size_, p.data());
    }
    return AllFinite(x_bar, num_inputs());
  }

  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    const int ns = state_size_;
    const int nc = control_size_;
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
    for (int t = num_steps_ - 1; t >= 0; --t) {
      const ConstRowMajorMap M_t(
          M.data() + t * StepJacobianSize(), ns, ns + nc);
      if (!StepHessian(&states[t * ns], x + t * nc, p.data(), &S)) return false;
      S.noalias() += M_t.transpose() * P * M_t;
      S.triangularView<Eigen::StrictlyUpper>() = S.transpose();  // to the bit
      const int column = t * nc;
      const int first_later = column + nc;
      const int num_later = num_inputs() - first_later;
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
    return AllFinite(hessian, num_inputs() * num_inputs());
  }

 private:
  template <typename Scalar>
  using RowMajor =
      Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using RowMajorMap = Eigen::Map<RowMajor<double>>;
  using ConstRowMajorMap = Eigen::Map<const RowMajor<double>>;

  int StepJacobianSize() const {
    return state_size_ * (state_size_ + control_size_);
  }

  bool RollOut(const double* x, const double* context, double* y) const {
    Scratch<double> next(state_size_);
    std::copy_n(context, state_size_, y);
    for (int t = 0; t < num_steps_; ++t) {
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
    const int ns = state_size_;
    const int size = ns + control_size_;
    Scratch<Jet> z(size);  // state and control
    Scratch<Jet> next(ns);
    std::copy_n(context, ns, y);
    for (int t = 0; t < num_steps_; ++t) {
      const double* control = x + t * control_size_;
      double* M_t = M + t * StepJacobianSize();
      if (states != nullptr) std::copy_n(y, ns, states + t * ns);
      for (int i = 0; i < ns; ++i) z[i] = Jet(y[i]);
      for (int i = ns; i < size; ++i) z[i] = Jet(control[i - ns]);
      for (int first = 0; first < size; first += kStride) {
        const int width = std::min(kStride, size - first);
        for (int k = 0; k < width; ++k) z[first + k].v[k] = 1.0;
        if (!step_(z.data(), z.data() + ns, next.data())) return false;
        for (int k = 0; k < width; ++k) z[first + k].v[k] = 0.0;
        for (int i = 0; i < ns; ++i) {
          std::copy_n(next[i].v.data(), width, M_t + i * size + first);
        }
      }
      for (int i = 0; i < ns; ++i) y[i] = next[i].a;
    }
    return AllFinite(y, ns) && AllFinite(M, num_steps_ * StepJacobianSize());
  }

  // Adds A_t^T p to `state_bar` and B_t^T p to `control_bar`.
  void AddTransposeTimes(const double* M_t,
                         const double* p,
                         double* state_bar,
                         double* control_bar) const {
    for (int i = 0; i < state_size_; ++i) {
      for (int k = 0; k < state_size_; ++k) state_bar[k] += p[i] * *M_t++;
      for (int k = 0; k < control_size_; ++k) control_bar[k] += p[i] * *M_t++;
    }
  }

  // The Hessian of p . step in state and control, in blocks of kStride.
  bool StepHessian(const double* state,
                   const double* control,
                   const double* p,
                   Eigen::MatrixXd* hessian) const {
    using Jet = NestedJet<kStride>;
    using Inner = InnerJet<kStride>;
    const int ns = state_size_;
    const int size = ns + control_size_;
    Scratch<Jet> z(size);
    Scratch<Jet> next(ns);
    for (int row = 0; row < size; row += kStride) {
      for (int col = 0; col <= row; col += kStride) {
        for (int i = 0; i < size; ++i) {
          z[i] = Jet(Inner(i < ns ? state[i] : control[i - ns]));
          if (i >= row && i < row + kStride) z[i].v[i - row] = Inner(1.0);
          if (i >= col && i < col + kStride) z[i].a.v[i - col] = 1.0;
        }
        if (!step_(z.data(), z.data() + ns, next.data())) return false;
        const int num_rows = std::min(kStride, size - row);
        const int num_cols = std::min(kStride, size - col);
        for (int j = 0; j < num_rows; ++j) {
          for (int k = 0; k < num_cols; ++k) {
            double sum = 0.0;
            for (int i = 0; i < ns; ++i) sum += p[i] * next[i].v[j].v[k];
            (*hessian)(row + j, col + k) = sum;
            (*hessian)(col + k, row + j) = sum;
          }
        }
      }
    }
    return true;
  }

  Step step_;
  int state_size_;
  int control_size_;
  int num_steps_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
