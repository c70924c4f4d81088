// A simulator that steps a state through time under controls.
//
//   s_{t+1} = step(s_t, u_t),   t = 0 .. N-1,   s_0 = c,   y = s_N
//
// It is differentiated a step at a time and chained backwards (roll_out.h).
// With A_t = ds_{t+1}/ds_t, B_t = ds_{t+1}/du_t:
//
//   Jacobian   C = I;     for t = N-1 .. 0:   J_t = C B_t,       C = C A_t
//   pull-back  p = w(y);  for t = N-1 .. 0:   x_bar_t = B_t^T p, p = A_t^T p
//
// It is also its own feedback: a network may put out u_t from s_t (feedback.h).
//
// Shapes:  s, c, y: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc.
//   template <typename T>
//   bool operator()(const T* state, const T* control, T* next_state) const;
// Cost:    J, pull-back, Hessian: those of roll_out.h; chaining J takes
//          2 ns^2 (ns + nc) N.
// Fails:   returns false if `step` does or a value is not finite.
#ifndef INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
#define INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_

#include <algorithm>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/chain/feedback.h"
#include "invgrad/chain/roll_out.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename Step, int kStride = 4>
class TimeSteppingSimulator final : public Simulator, public Feedback {
 public:
  TimeSteppingSimulator(Step step,
                        int state_size,
                        int control_size,
                        int num_steps)
      : roll_out_({std::move(step)}, state_size, control_size, 0, num_steps) {}

  int num_inputs() const override {
    return static_cast<int>(roll_out_.num_controls());
  }
  int num_outputs() const override { return state_size(); }
  int num_context() const override { return state_size(); }

  int num_calls() const override {
    return static_cast<int>(roll_out_.num_steps());
  }
  int state_size() const override {
    return static_cast<int>(roll_out_.state_size());
  }
  int control_size() const override {
    return static_cast<int>(roll_out_.control_size());
  }

  bool Advance(const double* state,
               const double* control,
               double* next_state) const override {
    return roll_out_.map()(0, state, control, next_state) &&
           AllFinite(next_state, state_size());
  }

  bool StepJacobians(const double* x,
                     const double* start,
                     double* M) const override {
    Scratch<double> state(state_size());
    return roll_out_.Linearize(x, start, state.data(), nullptr, nullptr, M);
  }

  bool StateHessian(const double* x,
                    const double* start,
                    const double* w,
                    double* hessian) const override {
    return RollOutStateHessian<kStride>(roll_out_.map().step,
                                        state_size(),
                                        control_size(),
                                        num_calls(),
                                        x,
                                        start,
                                        w,
                                        hessian);
  }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    if (jacobian == nullptr) return roll_out_.Run(x, context, y, nullptr);
    const Index ns = roll_out_.state_size();
    const Index nc = roll_out_.control_size();
    const Index num_steps = roll_out_.num_steps();
    const Index size = ns + nc;
    Scratch<double> M(num_steps * roll_out_.JacobianSize());
    if (!roll_out_.Linearize(x, context, y, nullptr, nullptr, M.data())) {
      return false;
    }
    // Both by rows: C, and C M_t = [C A_t, C B_t].
    Scratch<double> C(ns * ns);
    Scratch<double> CM(ns * size);
    Eigen::Map<Eigen::MatrixXd>(C.data(), ns, ns).setIdentity();
    for (Index t = num_steps - 1; t >= 0; --t) {
      const double* M_t = M.data() + t * roll_out_.JacobianSize();
      if (ns < kSmallState) {
        for (Index i = 0; i < ns; ++i) {
          roll_out_.TransposeTimes(
              M_t, C.data() + i * ns, CM.data() + i * size);
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
        std::copy(row + ns, row + size, jacobian + i * num_steps * nc + t * nc);
      }
    }
    return AllFinite(jacobian, ns * num_inputs());
  }

  bool PullBack(const double* x,
                const double* context,
                const Covector& covector,
                double* y,
                double* x_bar) const override {
    Scratch<double> M(roll_out_.num_steps() * roll_out_.JacobianSize());
    Scratch<double> p(state_size());
    if (!roll_out_.Linearize(x, context, y, nullptr, nullptr, M.data()) ||
        !covector(y, p.data())) {
      return false;
    }
    roll_out_.PullBack(M.data(), nullptr, p.data(), x_bar);
    return AllFinite(x_bar, num_inputs());
  }

  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    return roll_out_.WeightedHessian(
        x,
        context,
        nullptr,
        Eigen::Map<const Eigen::VectorXd>(w, state_size()),
        hessian);
  }

  std::string DescribeFailure(const double* x,
                              const double* context) const override {
    return roll_out_.DescribeFailure(x, context);
  }

 private:
  using Index = Eigen::Index;

  // Below this state size plain loops beat BLAS: 80 ns against 94 at 6, 183
  // against 108 at 8.
  static constexpr Index kSmallState = 7;

  RollOut<StepMap<Step>, kStride> roll_out_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
