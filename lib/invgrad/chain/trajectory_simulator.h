// A simulator that steps a state through time and puts out something at every
// step: its y holds the terms of a loss that adds up over time.
//
//   s_{t+1} = step(s_t, u_t),   z_t = output(t, s_{t+1}, u_t),   s_0 = c
//   y = (z_0, .., z_{N-1}),     t = 0 .. N-1
//
// With z_t = (sqrt(q_t) (s_{t+1} - s*), sqrt(rho) u_t) and y* = 0, say, a
// squared norm of y - y* is sum_t q_t |s_{t+1} - s*|^2 + rho |u_t|^2, where the
// last q_t may be the weight of the end: a least-squares problem that every
// rule and Ceres' trust regions can take. output = s_{t+1} gives the
// trajectory.
//
// With G_t the Jacobian of (s_{t+1}, z_t) in (s_t, u_t) (roll_out.h), its rows
// and columns named [A_t B_t; C_t D_t], and W = ds_t/dx:
//
//   Jacobian   W = 0;   for t = 0 .. N-1:
//                dz_t/dx = C_t W + D_t dx_t,   W = A_t W + B_t dx_t
//
// It is also its own feedback: a network may put out u_t from s_t (feedback.h).
//
// Shapes:  s, c: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc;  z: no;  y: N no.
//   template <typename T>   // step
//   bool operator()(const T* state, const T* control, T* next_state) const;
//   template <typename T>   // output
//   bool operator()(int t, const T* next_state, const T* control,
//                   T* output) const;
// Cost:    J, pull-back, Hessian: those of roll_out.h; chaining J takes
//          N^2 nc ns (ns + no).
// Fails:   returns false if `step` or `output` does or a value is not finite.
#ifndef INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
#define INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_

#include <algorithm>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/chain/feedback.h"
#include "invgrad/chain/roll_out.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename Step, typename Output, int kStride = 4>
class TrajectorySimulator final : public Simulator, public Feedback {
 public:
  TrajectorySimulator(Step step,
                      Output output,
                      int state_size,
                      int control_size,
                      int output_size,
                      int num_steps)
      : roll_out_({std::move(step), std::move(output), state_size},
                  state_size,
                  control_size,
                  output_size,
                  num_steps) {
    CHECK_GT(output_size, 0);
  }

  int num_inputs() const override {
    return static_cast<int>(roll_out_.num_controls());
  }
  int num_outputs() const override {
    return static_cast<int>(roll_out_.num_outputs());
  }
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
    return roll_out_.map().step(state, control, next_state) &&
           AllFinite(next_state, state_size());
  }

  bool StepJacobians(const double* x,
                     const double* start,
                     double* M) const override {
    const RollOut<StepMap<Step>, kStride> states(
        {roll_out_.map().step}, state_size(), control_size(), 0, num_calls());
    Scratch<double> state(state_size());
    return states.Linearize(x, start, state.data(), nullptr, nullptr, M);
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
    const Index ns = roll_out_.state_size();
    Scratch<double> state(ns);
    if (jacobian == nullptr) return roll_out_.Run(x, context, state.data(), y);
    const Index nc = roll_out_.control_size();
    const Index no = roll_out_.output_size();
    const Index num_x = num_inputs();
    const Index size = ns + nc;
    Scratch<double> G(roll_out_.num_steps() * roll_out_.JacobianSize());
    if (!roll_out_.Linearize(x, context, state.data(), y, nullptr, G.data())) {
      return false;
    }
    // Both transposed: row-major matrices by columns. The columns of W^T are
    // followed by those of dz_t/dx, which then move to J.
    Eigen::Map<Eigen::MatrixXd> J(jacobian, num_x, num_outputs());
    J.setZero();
    Scratch<double> memory((2 * ns + no) * num_x);
    Eigen::Map<Eigen::MatrixXd> W(memory.data(), num_x, ns);
    Eigen::Map<Eigen::MatrixXd> next(memory.data() + W.size(), num_x, ns + no);
    for (Index t = 0; t < roll_out_.num_steps(); ++t) {
      const Eigen::Map<const Eigen::MatrixXd> G_t(
          G.data() + t * roll_out_.JacobianSize(), size, ns + no);
      const Index num_earlier = t * nc;
      if (t > 0) {
        Gemm(Op::kNone,
             Op::kNone,
             1.0,
             W.topRows(num_earlier),
             G_t.topRows(ns),
             0.0,
             next.topRows(num_earlier));
      }
      next.middleRows(num_earlier, nc) = G_t.bottomRows(nc);
      const Index num_rows = num_earlier + nc;
      W.topRows(num_rows) = next.topLeftCorner(num_rows, ns);
      J.middleCols(t * no, no).topRows(num_rows) =
          next.topRightCorner(num_rows, no);
    }
    return AllFinite(jacobian, J.size());
  }

  bool PullBack(const double* x,
                const double* context,
                const Covector& covector,
                double* y,
                double* x_bar) const override {
    Scratch<double> G(roll_out_.num_steps() * roll_out_.JacobianSize());
    Scratch<double> w(num_outputs());
    Scratch<double> p(state_size());  // s_N, then its covector
    if (!roll_out_.Linearize(x, context, p.data(), y, nullptr, G.data()) ||
        !covector(y, w.data())) {
      return false;
    }
    std::fill_n(p.data(), state_size(), 0.0);
    roll_out_.PullBack(G.data(), w.data(), p.data(), x_bar);
    return AllFinite(x_bar, num_inputs());
  }

  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    return roll_out_.WeightedHessian(
        x, context, w, Eigen::VectorXd::Zero(state_size()), hessian);
  }

  std::string DescribeFailure(const double* x,
                              const double* context) const override {
    return roll_out_.DescribeFailure(x, context);
  }

 private:
  using Index = Eigen::Index;

  struct StepAndOutput {
    Step step;
    Output output;
    int state_size;

    template <typename T>
    bool operator()(Index t,
                    const T* state,
                    const T* control,
                    T* next_state_and_output) const {
      return step(state, control, next_state_and_output) &&
             output(static_cast<int>(t),
                    next_state_and_output,
                    control,
                    next_state_and_output + state_size);
    }
  };

  RollOut<StepAndOutput, kStride> roll_out_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
