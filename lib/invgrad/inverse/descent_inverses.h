// Inverse simulators that descend the distance in y, from P and its adjoint
// alone: for fields, whose J is too large to form.
//
//   F(x) = 1/2 |P(x; c) - y|^2,   gradient = J^T (P - y),   from x_now
//
//   gradient descent   x <- x - step_size gradient, num_steps times;
//                      rescale: x_now + (x - x_now) |d_1| / |x - x_now|,
//                      d_1 the first step ("GD accumulate" of [1])
//   L-BFGS             by ceres::GradientProblemSolver, until F or its gradient
//                      falls by less than `tolerance`, relative to their values
//                      at x_now, or for max_num_iterations
//
// One step of gradient descent is step_size times the adjoint. For a linear P of
// singular values s, num_steps leave (1 - step_size s^2)^num_steps of the error
// along each singular vector: step_size must be below 2 / s_max^2, and the
// result is first-order in the condition of P.
//
// Shapes:  x: num_inputs;  y: num_outputs.
// Units:   step_size in [x]^2 / [y]^2.
// Cost:    a step, or an evaluation of the line search: one Simulator::Adjoint.
// Fails:   Invert returns false, with *why, if P or its adjoint has no finite
//          value at x_now, at a step of gradient descent, or if L-BFGS finds no
//          point with a smaller F.
//
// [1] Holl, Koltun, Thuerey, arXiv 2109.15048, and the code tum-pbs/SIP, fluid:
//     8 gradient steps, 16 iterations of L-BFGS-B with tolerance 1e-5.
#ifndef INVGRAD_INVERSE_DESCENT_INVERSES_H_
#define INVGRAD_INVERSE_DESCENT_INVERSES_H_

#include <memory>
#include <string>

#include "invgrad/chain/simulator.h"
#include "invgrad/inverse/inverse_simulator.h"

namespace invgrad {

class GradientDescentInverse final : public InverseSimulator {
 public:
  struct Options {
    int num_steps = 8;
    double step_size = 1.0;
    bool rescale = false;
  };

  GradientDescentInverse(std::shared_ptr<const Simulator> simulator,
                         const Options& options);

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override;

  bool reaches_target() const override { return false; }

 private:
  std::shared_ptr<const Simulator> simulator_;
  Options options_;
};

class LbfgsInverse final : public InverseSimulator {
 public:
  struct Options {
    int max_num_iterations = 16;
    double tolerance = 1e-5;
  };

  LbfgsInverse(std::shared_ptr<const Simulator> simulator,
               const Options& options);

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override;

  bool reaches_target() const override { return false; }

 private:
  std::shared_ptr<const Simulator> simulator_;
  Options options_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_DESCENT_INVERSES_H_
