// A simulator that steps a state through time under controls.
//
//   s_{t+1} = step(s_t, u_t),   t = 0 .. N-1,   s_0 = c,   y = s_N
//
// Derivatives of single steps are chained backwards (roll_out.h). With
// A_t = ds_{t+1}/ds_t, B_t = ds_{t+1}/du_t:
//
//   Jacobian  C = I;     for t = N-1 .. 0:   J_t = C B_t,       C = C A_t
//   adjoint   p = w(y);  for t = N-1 .. 0:   x_bar_t = B_t^T p, p = A_t^T p
//
// The simulator is also its own feedback: a network may compute u_t from s_t
// (feedback.h).
//
// Shapes:  s, c, y: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc.
//   template <typename T>
//   bool operator()(const T* state, const T* control, T* next_state) const;
// Cost:    J, adjoint, Hessian: see roll_out.h and autodiff_step.h; chaining J
//          takes 2 ns^2 (ns + nc) N.
// Fails:   returns false if `step` returns false or a value is not finite.
#ifndef INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
#define INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_

#include <memory>
#include <string>
#include <utility>

#include "invgrad/chain/autodiff_step.h"
#include "invgrad/chain/stepped_simulator.h"

namespace invgrad {

// From any TimeStep without outputs.
class TimeSteppingBase : public SteppedSimulator {
 public:
  explicit TimeSteppingBase(RollOut roll_out);

  int num_outputs() const override { return state_size(); }
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
};

template <typename Step, int kStride = 4>
class TimeSteppingSimulator final : public TimeSteppingBase {
 public:
  TimeSteppingSimulator(Step step,
                        int state_size,
                        int control_size,
                        int num_steps)
      : TimeSteppingBase(RollOut(
            std::make_shared<AutoDiffStep<StepWithoutOutput<Step>, kStride>>(
                StepWithoutOutput<Step>{std::move(step)},
                state_size,
                control_size,
                /*output_size=*/0),
            num_steps)) {}
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TIME_STEPPING_SIMULATOR_H_
