// Descents in x of a function of y = P(x; c), from P and its adjoint alone: ways
// through simulators of fields, whose J is too large to form.
//
//   minimize F(P(x; c)),   gradient = J^T dF/dy,   from the current x
//
//   gradient descent   x <- x - step_size gradient, num_steps times;
//                      rescale: the sum of the steps is scaled to the length of
//                      the first ("GD accumulate" of [1])
//   L-BFGS             by ceres::GradientProblemSolver, until F changes by less
//                      than tolerance F in an iteration, or the gradient is less
//                      than `tolerance` times that at the start, or for
//                      max_num_iterations
//
// With F = 1/2 |y - y~|^2 one step of gradient descent is step_size times the
// adjoint, and for a linear P of singular values s, num_steps leave
// (1 - step_size s^2)^num_steps of the error along each singular vector:
// step_size must be below 2 / s_max^2, and the inverse is first-order in the
// condition of P.
//
// Shapes:  x: num_inputs;  y: num_outputs.
// Units:   step_size in [x]^2 / [F].
// Cost:    a step, or an evaluation of the line search: one Simulator::Adjoint.
// Fails:   returns false, with *why, if P, its adjoint or F has no finite value
//          at the start, or after a step of gradient descent, or if L-BFGS finds
//          no point with a smaller F.
//
// [1] Holl, Koltun, Thuerey, arXiv 2109.15048, and the code tum-pbs/SIP, fluid:
//     8 gradient steps, 16 iterations of L-BFGS-B with tolerance 1e-5.
#ifndef INVGRAD_INVERSE_DESCENTS_H_
#define INVGRAD_INVERSE_DESCENTS_H_

#include <functional>
#include <string>

#include "Eigen/Core"
#include "invgrad/simulator.h"

namespace invgrad {

// Computes F and -dF/dy (num_outputs) at y. Returns false without a finite
// value.
using OutputFunction =
    std::function<bool(const double* y, double* F, double* descent)>;

struct GradientDescentOptions {
  int num_steps = 8;
  double step_size = 1.0;
  bool rescale = false;
};

bool DescendByGradient(const Simulator& simulator,
                       const double* context,
                       const OutputFunction& function,
                       const GradientDescentOptions& options,
                       Eigen::VectorXd* x,
                       std::string* why);

struct LbfgsOptions {
  int max_num_iterations = 16;
  double tolerance = 1e-5;
};

bool DescendByLbfgs(const Simulator& simulator,
                    const double* context,
                    const OutputFunction& function,
                    const LbfgsOptions& options,
                    Eigen::VectorXd* x,
                    std::string* why);

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_DESCENTS_H_
