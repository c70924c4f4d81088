// The inverse of a simulator, computed from P and its Jacobian.
//
//   x = argmin 1/2 |P(x; c) - y|^2,   from x_now, by Levenberg-Marquardt
//   d = -V S (S^2 + mu)^-1 U^T r,     J = U S V^T
//
// The residual r is divided by its norm at x_now, so all tolerances are
// relative to the wanted change. From x_now the iteration finds a nearby
// pre-image, not always the closest: a local inverse. The damping mu is the
// same for all directions, so every step is in the row space of its J: with
// more unknowns than outputs x moves no farther than necessary, and for a
// linear P it is the closest solution. One decomposition serves every mu at a
// point. (Ceres' minimizers damp by diag(J^T J): for one output and three
// inputs they stall or end far from the closest solution.)
//
// Shapes:  x: n = num_inputs;  y: m = num_outputs.
// Cost:    an iteration: one P and, unless the last step was rejected, one
//          Jacobian with its decomposition.
// Fails:   returns false, with x the best point found, if |P(x) - y| stays
//          above tolerance |P(x_now) - y|: y is out of range, or P too
//          nonlinear for max_num_iterations. x = x_now if P has no finite value
//          at x_now.
//
// Source:  Madsen, Nielsen, Tingleff. Methods for Non-linear Least Squares
//          Problems. 2nd edition, DTU 2004, algorithm 3.16.
#ifndef INVGRAD_INVERSE_NUMERICAL_INVERSE_H_
#define INVGRAD_INVERSE_NUMERICAL_INVERSE_H_

#include <memory>
#include <string>

#include "invgrad/inverse_simulator.h"
#include "invgrad/simulator.h"

namespace invgrad {

class NumericalInverse final : public InverseSimulator {
 public:
  struct Options {
    int max_num_iterations = 50;
    double tolerance = 1e-6;
  };

  NumericalInverse(std::shared_ptr<const Simulator> simulator,
                   const Options& options);

  bool Invert(const ConstVectorRef& y,
              const ConstVectorRef& x_now,
              const ConstVectorRef& context,
              Eigen::VectorXd* x,
              std::string* why) const override;

 private:
  std::shared_ptr<const Simulator> simulator_;
  Options options_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_NUMERICAL_INVERSE_H_
