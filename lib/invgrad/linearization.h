// The linearization of a problem at its current point: what an update rule
// reads. Write a rule with it (update_rule.h); the loops and UpdateCallback
// fill it.
//
//   L(y(x + d)) ~ L + g . (J d) + 1/2 (J d) . H_L (J d)
//
//   g = dL/dy,   J = dy/dx,   H_L = d2L/dy2,   gradient = J^T g
//
// If the outputs keep a quantity (Loss::has_invariant), this model is wrong in
// second order. The loss along a curve of outputs that keep it needs no model:
//
//   eta -> L(R(y, t, eta)),   R(y, t, 0) = y,   dR/deta(y, t, 0) = t = J d
//
// Shapes:  x, d: n;  y, g: m;  J: m x n;  H_L: m x m, block diagonal.
// Units:   x has one unit per entry, y likewise; g is [L]/[y], J is [y]/[x].
//          A half-inverse step changes with these units, see
//          docs/conventions.md.
//
// For a ceres::Problem, y = r, its residuals (corrected for robust losses),
// L = 1/2 |r|^2, hence g = r and H_L = I. For a model (network, simulator,
// loss), y stacks the simulator outputs of all samples of the batch, and L is
// the batch's loss: factors such as 2 / B are part of g and H_L, not of J.
#ifndef INVGRAD_LINEARIZATION_H_
#define INVGRAD_LINEARIZATION_H_

#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

// The parts to compute, and for the loop what a rule does with them. The cost
// is always computed; each further part costs time.
struct LinearizationParts {
  bool gradient = false;       // J^T g
  bool jacobian = false;       // g, J and H_L
  bool hessian = false;        // d2L/dx2, exact
  bool loss_gradient = false;  // g alone
  // v -> d2L/dx2 v (hessian_times.h), and linearizations at other points. Both
  // are set by the loop that owns the objective.
  bool hessian_times = false;
  bool after = false;

  // Whether the rule reads Linearization::progress: its steps then depend on
  // the run's budget.
  bool progress = false;
  // What the rule does with J, for the limits on time and memory (step_cost.h):
  // whether it factorizes J or a Gram matrix, by Cholesky if not by all singular
  // values, or otherwise how many products with J and J^T it takes, at most.
  bool factorization = false;
  bool by_cholesky = false;
  bool by_parameter_gram = false;  // by J^T J even if m < n
  bool uses_sparsity = false;  // of J, if it is stored so, in the factorization
  int num_products = 0;
  int num_squares = 0;  // of n x n numbers that the rule keeps

  static LinearizationParts Gradient() {
    LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  static LinearizationParts Jacobian() {
    LinearizationParts parts;
    parts.jacobian = true;
    return parts;
  }
  static LinearizationParts LossGradient() {
    LinearizationParts parts;
    parts.loss_gradient = true;
    return parts;
  }
};

// The loss at a point R(eta) of a curve of outputs. NaN if it is not finite.
struct LossOnCurve {
  double loss = 0.0;   // L
  double slope = 0.0;  // dL/deta
  // |dR/deta| / |R| of the sample that moves fastest: on great circles, the
  // angle per eta.
  double speed = 0.0;
};

struct Linearization;

// Linearizes at x + step, with the same samples. Returns false, with *error, if
// the cost or a part has no finite value there. Valid until the objective
// moves.
using LinearizeAfter = std::function<bool(const Eigen::VectorXd& step,
                                          const LinearizationParts& parts,
                                          Linearization* after,
                                          std::string* error)>;

struct Linearization {
  double cost = 0.0;         // L
  Eigen::VectorXd gradient;  // n: J^T g

  Eigen::VectorXd loss_gradient;                     // m: g
  std::shared_ptr<const JacobianOperator> jacobian;  // m x n: J
  // v -> H_L v, both m. Empty: H_L is the identity.
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> loss_hessian_times;

  // (t, eta) -> the loss on the curve from y in the direction t (m). Empty: the
  // outputs keep nothing, and the model with H_L stands for it.
  std::function<LossOnCurve(const Eigen::VectorXd& t, double eta)>
      loss_on_curve;

  Eigen::MatrixXd hessian;  // n x n, symmetric: d2L/dx2

  // *Hv = d2L/dx2 v, both n; returns false, with *error, if that has no finite
  // value. Valid until the objective moves. Empty: not computed.
  std::function<bool(
      const Eigen::VectorXd& v, Eigen::VectorXd* Hv, std::string* error)>
      hessian_times;

  LinearizeAfter after;    // empty: not known
  double norm_of_x = 0.0;  // |x|; set with `after`

  // g, J, H_L and the curve of this rank's samples, if ranks share J
  // (shared_jacobian.h); null: those above.
  std::shared_ptr<const Linearization> own;

  // The share of the run's budget that is spent, in [0, 1], for step-size
  // schedules. Set by the training or minimization loop.
  double progress = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_LINEARIZATION_H_
