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
// With G_t the Jacobian of (s_{t+1}, z_t) in (s_t, u_t) (roll_out.h), its rows
// and columns named [A_t B_t; C_t D_t], and W = ds_t/dx:
//
//   Jacobian   W = 0;   for t = 0 .. N-1:
//                dz_t/dx = C_t W + D_t dx_t,   W = A_t W + B_t dx_t
//
// The simulator is also its own feedback: a network may compute u_t from s_t
// (feedback.h).
//
// Shapes:  s, c: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc;  z: no;  y: N no.
//   template <typename T>   // step
//   bool operator()(const T* state, const T* control, T* next_state) const;
//   template <typename T>   // output
//   bool operator()(int t, const T* next_state, const T* control,
//                   T* output) const;
// Cost:    J, adjoint, Hessian: see roll_out.h and autodiff_step.h; chaining J
//          takes N^2 nc ns (ns + no).
// Fails:   returns false if `step` or `output` returns false or a value is not
//          finite.
#ifndef INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
#define INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_

#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/chain/autodiff_step.h"
#include "invgrad/chain/stepped_simulator.h"

namespace invgrad {

// From a TimeStep with outputs, and the same step without outputs.
class TrajectoryBase : public SteppedSimulator {
 public:
  TrajectoryBase(RollOut roll_out, RollOut states);

  int num_outputs() const override {
    return static_cast<int>(roll_out_.num_outputs());
  }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  std::string DescribeFailure(const double* x,
                              const double* context) const override;

 private:
  RollOut roll_out_;
};

// The functor of a step with output.
template <typename Step, typename Output>
struct StepWithOutput {
  Step step;
  Output output;
  int state_size;

  template <typename T>
  bool operator()(Eigen::Index t,
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

template <typename Step, typename Output, int kStride = 4>
class TrajectorySimulator final : public TrajectoryBase {
 public:
  TrajectorySimulator(Step step,
                      Output output,
                      int state_size,
                      int control_size,
                      int output_size,
                      int num_steps)
      : TrajectoryBase(
            RollOut(std::make_shared<
                        AutoDiffStep<StepWithOutput<Step, Output>, kStride>>(
                        StepWithOutput<Step, Output>{
                            step, std::move(output), state_size},
                        state_size,
                        control_size,
                        output_size),
                    num_steps),
            RollOut(std::make_shared<
                        FirstOrderStep<StepWithoutOutput<Step>, kStride>>(
                        StepWithoutOutput<Step>{step},
                        state_size,
                        control_size,
                        /*output_size=*/0),
                    num_steps)) {}
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TRAJECTORY_SIMULATOR_H_
