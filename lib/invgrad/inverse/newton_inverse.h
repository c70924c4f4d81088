// A saddle-free Newton step of the distance in y, as an inverse simulator for
// few inputs.
//
//   F(x) = 1/2 |P(x; c) - y|^2,   g = J^T (P - y),
//   H = J^T J + sum_i (P_i - y_i) d2P_i/dx2 = Q diag(lambda) Q^T
//   x = x_now - Q d,   |d_i| = |Q^T g|_i / (|lambda_i| + damping)
//
// and, if lambda_i is not above the geometric mean of all |lambda|,
// |d_i| <= max_loss_change / |Q^T g|_i: along directions of low curvature F
// changes by about max_loss_change at most. d_i has the sign of (Q^T g)_i, so a
// saddle repels. Slopes |Q^T g|_i below 1e-14 |g| are rounding errors and give
// d_i = 0, because P does not depend on these directions. The step is repeated
// num_steps times.
//
// Shapes:  x: n = num_inputs;  y: num_outputs;  Q: n x n.
// Units:   max_loss_change in [y]^2; damping in [y]^2 / [x]^2.
// Cost:    a step: one Jacobian, one WeightedHessian, one symmetric eigenvalue
//          problem of size n.
// Fails:   returns false if P or a derivative has no finite value. CHECKs that
//          the simulator has second derivatives (CheckHasHessian).
//
// Source:  Holl, Koltun, Thuerey, arXiv 2109.15048, section 4.1, and their
//          code's sin_characterization; Dauphin et al., Identifying and
//          attacking the saddle point problem, NeurIPS 2014.
#ifndef INVGRAD_INVERSE_NEWTON_INVERSE_H_
#define INVGRAD_INVERSE_NEWTON_INVERSE_H_

#include <memory>
#include <string>

#include "invgrad/inverse_simulator.h"
#include "invgrad/simulator.h"

namespace invgrad {

class NewtonInverse final : public InverseSimulator {
 public:
  struct Options {
    int num_steps = 1;
    double max_loss_change = 0.2;
    double damping = 0.0;
  };

  NewtonInverse(std::shared_ptr<const Simulator> simulator,
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

#endif  // INVGRAD_INVERSE_NEWTON_INVERSE_H_
