// Feedback: the network is part of the simulator's loop over time and is called
// at every step.
//
//   u_t = f(a_t; theta),   a_t = (s_t, r),   s_{t+1} = step(s_t, u_t)
//   x = (u_0, .., u_{T-1}),   t = 0 .. T-1
//
// The simulator itself is open: y = P(x; s_0) for given controls x. Loss,
// simulator and every pull-back to x are therefore the same as without the
// loop; the loop only affects the derivatives of x with respect to the weights.
// With K_t = du_t/ds_t, K = diag(K_t), S = ds/dx of the open simulator and df
// the change of the controls at fixed states,
//
//   dx = df + K S dx = (I - K S)^-1 df
//
// Model::CloseLoop multiplies a covector of x, or each row of J_y_x, by
// (I - K S)^-1, by a recursion backwards in time that forms neither K nor S
// (backpropagation through time [1]). With A_t = ds_{t+1}/ds_t and
// B_t = ds_{t+1}/du_t:
//
//   p = 0;   for t = T-1 .. 0:   x_bar_t += B_t^T p
//                                p = A_t^T p + K_t^T x_bar_t
//
// Second derivatives are not available.
//
// Shapes:  s: ns;  u: nc;  x: T nc;  K_t: nc x ns;  A_t: ns x ns;
//          B_t: ns x nc.
// Cost:    of CloseLoop, a sample: one StepJacobians and 2 T (ns + 2 nc) ns a
//          covector.
// Fails:   every function returns false if the simulator has no finite value.
// Implementations are immutable, so that several threads may share one.
//
// [1] Werbos. Backpropagation through time: what it does and how to do it.
//     Proceedings of the IEEE 78 (1990).
#ifndef INVGRAD_INTERNAL_FEEDBACK_H_
#define INVGRAD_INTERNAL_FEEDBACK_H_

namespace invgrad {

// The functions of a simulator that the loop needs.
class Feedback {
 public:
  virtual ~Feedback() = default;

  virtual int num_calls() const = 0;     // T
  virtual int state_size() const = 0;    // ns
  virtual int control_size() const = 0;  // nc

  // Computes s_{t+1} from s_t and u_t.
  virtual bool Advance(const double* state,
                       const double* control,
                       double* next_state) const = 0;

  // Computes M_t = [A_t B_t] along the roll-out of the controls x from the
  // state `start`: T matrices ns x (ns + nc), row-major, one after the other.
  virtual bool StepJacobians(const double* x,
                             const double* start,
                             double* M) const = 0;

  // The same for `count` samples, one column a sample, M one after the other.
  // Return the number of samples before the first that fails.
  virtual int AdvanceBatch(int count,
                           const double* states,
                           const double* controls,
                           double* next_states) const;
  virtual int StepJacobiansBatch(int count,
                                 const double* x,
                                 const double* starts,
                                 double* M) const;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_FEEDBACK_H_
