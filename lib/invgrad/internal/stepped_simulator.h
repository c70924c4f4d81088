// The common part of the simulators that step a state through time
// (time_stepping_simulator.h, trajectory_simulator.h).
//
//   s_{t+1} = step(s_t, u_t),   z_t = output(t, s_{t+1}, u_t),
//   t = 0 .. N-1,   s_0 = c
//   y = (z_0, .., z_{N-1}),   or s_N if the step has no outputs z
//
// The steps' derivatives are chained [1]. With G_t = [A_t B_t; C_t D_t] the
// Jacobian of a step in (s_t, u_t), M_t = [A_t B_t], and covectors w_t of z_t
// and p of s_N:
//
//   Jacobian  of s_N:  C = I;  for t = N-1 .. 0:   J_t = C B_t,   C = C A_t
//             of z:    W = 0;  for t = 0 .. N-1:
//               dz_t/dx = C_t W + D_t dx_t,   W = A_t W + B_t dx_t
//   context   W = I;  for t = 0 .. N-1:   dz_t/dc = C_t W,   W = A_t W
//   adjoint   for t = N-1 .. 0:   [p; x_bar_t] = G_t^T [p; w_t]
//   Hessian   of F = p . s_N + sum_t w_t . z_t in x. Before step t let p, P =
//             dF/ds, d2F/ds2 and R = the mixed derivatives with respect to s
//             and all later controls. With Q_t the Hessian of [p; w_t] . step:
//               S = Q_t + M_t^T P M_t:   P = S_ss, R_t = S_su, H_tt = S_uu
//               later controls k > t:    [R_k; H_tk] = M_t^T R_k
//
// The simulator is also its own feedback: a network may compute u_t from s_t.
//
// Shapes:  s, c: ns;  u: nc;  x = u_0 .. u_{N-1}: N nc;  z: no;
//          G_t: (ns + no) x (ns + nc), row-major.
// Cost:    one call of the step's function per time step; chaining J takes
//          2 ns^2 (ns + nc) N for s_N and N^2 nc ns (ns + no) for z, chaining
//          the Hessian N^2 nc ns (ns + nc).
//          Batches: four samples at once (pack.h), with the same bits.
// Fails:   returns false if a step returns false or a value is not finite.
//
// [1] Griewank, Walther. Evaluating Derivatives. 2nd edition, SIAM 2008,
//     chapter 3: forward mode inside a step, reverse mode over the steps.
#ifndef INVGRAD_INTERNAL_STEPPED_SIMULATOR_H_
#define INVGRAD_INTERNAL_STEPPED_SIMULATOR_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/internal/feedback.h"
#include "invgrad/internal/pack.h"
#include "invgrad/simulator.h"

namespace invgrad {

class SteppedSimulator : public Simulator, public Feedback {
 public:
  int num_inputs() const override { return num_steps_ * control_size_; }
  int num_outputs() const override {
    return output_size_ == 0 ? state_size_ : num_steps_ * output_size_;
  }
  int num_context() const override { return state_size_; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  int EvaluateBatch(int count,
                    const double* x,
                    const double* contexts,
                    double* y,
                    double* jacobians) const override;
  int AdjointBatch(int count,
                   const double* x,
                   const double* contexts,
                   const BatchCovector& covector,
                   double* x_bar) const override;
  bool has_context_jacobian() const override { return true; }
  bool ContextJacobian(const double* x,
                       const double* context,
                       double* jacobian) const override;
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  std::string DescribeFailure(const double* x,
                              const double* context) const override;

  int num_calls() const override { return num_steps_; }
  int state_size() const override { return state_size_; }
  int control_size() const override { return control_size_; }
  bool Advance(const double* state,
               const double* control,
               double* next_state) const override;
  bool StepJacobians(const double* x,
                     const double* start,
                     double* M) const override;
  int AdvanceBatch(int count,
                   const double* states,
                   const double* controls,
                   double* next_states) const override;
  int StepJacobiansBatch(int count,
                         const double* x,
                         const double* starts,
                         double* M) const override;

 protected:
  using Index = Eigen::Index;

  SteppedSimulator(int state_size,
                   int control_size,
                   int output_size,
                   int num_steps);

  // Steps t = begin .. end - 1 from *state = s_begin to s_end, under the
  // controls x of all steps. rows = ns + no also computes the z_t, rows = ns
  // does not. Writes, unless null, s_t to states, z_t to outputs and these rows
  // of G_t to G, each at the place of step t. Returns false if a step does.
  virtual bool Steps(Index begin,
                     Index end,
                     const double* x,
                     Index rows,
                     double* state,
                     double* states,
                     double* outputs,
                     double* G) const = 0;
  // The same for four samples; called unless WhyNoLanes() says why not.
  virtual bool Steps(Index begin,
                     Index end,
                     const Pack* x,
                     Index rows,
                     Pack* state,
                     Pack* states,
                     Pack* outputs,
                     Pack* G) const = 0;
  // Computes the Hessian of covector . (s_{t+1}, z_t) in (s_t, u_t).
  virtual bool StepHessian(Index t,
                           const double* state,
                           const double* control,
                           const Eigen::VectorXd& covector,
                           Eigen::MatrixXd* hessian) const = 0;

 private:
  // rows = ns + no: computes y. rows = ns: computes s_N, in *y. Also writes,
  // unless null, the states before the steps and these rows of all G_t.
  // T: double, or Pack for four samples.
  template <typename T>
  bool RollOut(
      const T* x, const T* start, Index rows, T* y, T* states, T* G) const;
  template <typename T>
  void ChainToEnd(const T* G, T* jacobian) const;
  // Whether ChainToEnd is faster in lanes than with BLAS.
  bool ChainsInLanes() const;
  void ChainToOutputs(const double* G, double* jacobian) const;
  // x_bar for the covectors w of y.
  template <typename T>
  bool ChainBack(const T* G, const T* w, T* x_bar) const;
  // The functions for four samples; one column a sample.
  bool EvaluateLanes(const double* x,
                     const double* contexts,
                     double* y,
                     double* jacobians) const;
  bool AdjointLanes(int first,
                    const double* x,
                    const double* contexts,
                    const BatchCovector& covector,
                    double* x_bar) const;
  Index JacobianSize() const { return Index{num_outputs()} * num_inputs(); }

  int state_size_;
  int control_size_;
  int output_size_;
  int num_steps_;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_STEPPED_SIMULATOR_H_
