// A roll-out through time and its derivatives, one step at a time: the common
// part of the time-stepping simulators.
//
//   (s_{t+1}, z_t) = step(t, s_t, u_t),   t = 0 .. N-1
//
// The steps' Jacobians and Hessians are chained backwards [1]. With G_t the
// Jacobian of the step in (s_t, u_t), its first rows
// M_t = [A_t B_t] = ds_{t+1}/d(s_t, u_t), and covectors w_t of z_t and p of
// s_N:
//
//   adjoint  for t = N-1 .. 0:   [p; x_bar_t] = G_t^T [p; w_t]
//   Hessian  of F = p . s_N + sum_t w_t . z_t in x. Before step t let p, P =
//            dF/ds, d2F/ds2 and R = the mixed derivatives with respect to s and
//            all later controls. With Q_t the Hessian of [p; w_t] . step in
//            (s_t, u_t):
//              S = Q_t + M_t^T P M_t:   P = S_ss, R_t = S_su, H_tt = S_uu
//              later controls k > t:    [R_k; H_tk] = M_t^T R_k
//
// Shapes:  s: ns;  u: nc;  z: no, perhaps 0;  x = u_0 .. u_{N-1}: N nc;
//          z_0 .. z_{N-1}: N no;  G_t: (ns + no) x (ns + nc), row-major.
// Cost:    one call of the step's function per time step; chaining the Hessian
//          takes N^2 nc ns (ns + nc).
// Fails:   returns false if a step returns false or a value is not finite.
//
// [1] Griewank, Walther. Evaluating Derivatives. 2nd edition, SIAM 2008,
//     chapter 3: forward mode inside a step, reverse mode over the steps.
#ifndef INVGRAD_CHAIN_ROLL_OUT_H_
#define INVGRAD_CHAIN_ROLL_OUT_H_

#include <memory>
#include <string>

#include "Eigen/Core"

namespace invgrad {

// One step of time with its derivatives; autodiff_step.h makes it from a
// functor. `next` is (s_{t+1}, z_t): ns + no numbers.
class TimeStep {
 public:
  using Index = Eigen::Index;

  TimeStep(int state_size, int control_size, int output_size);
  virtual ~TimeStep() = default;

  Index state_size() const { return state_size_; }      // ns
  Index control_size() const { return control_size_; }  // nc
  Index output_size() const { return output_size_; }    // no

  virtual bool Evaluate(Index t,
                        const double* state,
                        const double* control,
                        double* next) const = 0;
  // Also computes G_t.
  virtual bool Linearize(Index t,
                         const double* state,
                         const double* control,
                         double* next,
                         double* G_t) const = 0;
  // Computes the Hessian of covector . next in (s_t, u_t), (ns + nc) x
  // (ns + nc). Optional: only RollOut::WeightedHessian calls it.
  virtual bool WeightedHessian(Index t,
                               const double* state,
                               const double* control,
                               const Eigen::VectorXd& covector,
                               Eigen::MatrixXd* hessian) const;

 private:
  Index state_size_;
  Index control_size_;
  Index output_size_;
};

// pulled = A^T w for a row-major A, by sums in registers, which is fastest for
// the sizes of one time step.
inline void TransposeTimes(Eigen::Index rows,
                           Eigen::Index cols,
                           const double* A,
                           const double* w,
                           double* pulled) {
  for (Eigen::Index k = 0; k < cols; ++k) {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < rows; ++i) sum += A[i * cols + k] * w[i];
    pulled[k] = sum;
  }
}

class RollOut {
 public:
  using Index = Eigen::Index;

  RollOut(std::shared_ptr<const TimeStep> step, int num_steps);

  const TimeStep& step() const { return *step_; }
  Index state_size() const { return step_->state_size(); }      // ns
  Index control_size() const { return step_->control_size(); }  // nc
  Index output_size() const { return step_->output_size(); }    // no
  Index num_steps() const { return num_steps_; }                // N
  Index num_controls() const { return num_steps_ * control_size(); }
  Index num_outputs() const { return num_steps_ * output_size(); }
  // Entries of G_t.
  Index JacobianSize() const {
    return (state_size() + output_size()) * (state_size() + control_size());
  }

  // Computes s_N and, if there are any, the outputs.
  bool Run(const double* x,
           const double* start,
           double* state,
           double* outputs) const;

  // Computes the same with G_t of every step and, unless `states` is null, the
  // states before the steps.
  bool Linearize(const double* x,
                 const double* start,
                 double* state,
                 double* outputs,
                 double* states,
                 double* G) const;

  // Replaces p by the covector of s_0 and computes the covector of x. w is not
  // read if there are no outputs.
  void Adjoint(const double* G,
               const double* w,
               double* p,
               double* x_bar) const;

  // Computes H (N nc x N nc), symmetric to the bit, for the covectors p of s_N
  // and w of the outputs.
  bool WeightedHessian(const double* x,
                       const double* start,
                       const double* w,
                       Eigen::VectorXd p,
                       double* hessian) const;

  // Simulator::DescribeFailure: the step at which Run, Linearize,
  // WeightedHessian or a chain of G_t failed.
  std::string DescribeFailure(const double* x, const double* start) const;

 private:
  // Writes [p; w_t].
  void StackCovectors(Index t,
                      const double* p,
                      const double* w,
                      double* covector) const;

  std::shared_ptr<const TimeStep> step_;
  Index num_steps_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_ROLL_OUT_H_
