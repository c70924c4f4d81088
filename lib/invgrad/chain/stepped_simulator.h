// The common part of the time-stepping simulators: sizes, and the feedback in
// which a network computes u_t from s_t (feedback.h).
//
//   s_{t+1} = step(s_t, u_t),   t = 0 .. N-1,   s_0 = c
//
// Shapes:  s, c: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc.
#ifndef INVGRAD_CHAIN_STEPPED_SIMULATOR_H_
#define INVGRAD_CHAIN_STEPPED_SIMULATOR_H_

#include "invgrad/chain/feedback.h"
#include "invgrad/chain/roll_out.h"
#include "invgrad/chain/simulator.h"

namespace invgrad {

class SteppedSimulator : public Simulator, public Feedback {
 public:
  int num_inputs() const override {
    return static_cast<int>(states_.num_controls());
  }
  int num_context() const override { return state_size(); }

  int num_calls() const override {
    return static_cast<int>(states_.num_steps());
  }
  int state_size() const override {
    return static_cast<int>(states_.state_size());
  }
  int control_size() const override {
    return static_cast<int>(states_.control_size());
  }
  bool Advance(const double* state,
               const double* control,
               double* next_state) const override;
  bool StepJacobians(const double* x,
                     const double* start,
                     double* M) const override;

  bool has_weighted_hessian() const override { return true; }

 protected:
  using Index = Eigen::Index;

  // The step must have no outputs (CHECKed).
  explicit SteppedSimulator(RollOut states);
  const RollOut& states() const { return states_; }

 private:
  RollOut states_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_STEPPED_SIMULATOR_H_
