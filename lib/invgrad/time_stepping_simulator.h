// A simulator that steps a state through time under controls.
//
//   s_{t+1} = step(s_t, u_t),   t = 0 .. N-1,   s_0 = c,   y = s_N
//
// It is also its own feedback: a network may compute u_t from s_t (feedback.h).
//
// Shapes:  s, c, y: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc.
//   template <typename T>
//   bool operator()(const T* state, const T* control, T* next_state) const;
// Cost:    that of trajectory_simulator.h.
// Fails:   returns false if `step` returns false or a value is not finite.
#ifndef INVGRAD_TIME_STEPPING_SIMULATOR_H_
#define INVGRAD_TIME_STEPPING_SIMULATOR_H_

#include <utility>

#include "invgrad/internal/trajectory_simulator.h"

namespace invgrad {

struct NoOutput {
  template <typename T>
  bool operator()(int /*t*/, const T* /*s*/, const T* /*u*/, T* /*z*/) const {
    return true;
  }
};

template <typename Step, int kStride = 4>
class TimeSteppingSimulator final
    : public TrajectorySimulator<Step, NoOutput, kStride> {
 public:
  TimeSteppingSimulator(Step step,
                        int state_size,
                        int control_size,
                        int num_steps)
      : TrajectorySimulator<Step, NoOutput, kStride>(std::move(step),
                                                     NoOutput(),
                                                     state_size,
                                                     control_size,
                                                     /*output_size=*/0,
                                                     num_steps) {}
};

}  // namespace invgrad

#endif  // INVGRAD_TIME_STEPPING_SIMULATOR_H_
