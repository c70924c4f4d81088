// Linearizes any ceres::Problem at the current values of its parameter blocks.
//
//   L = 1/2 sum_b rho_b(|r_b|^2),   y = r~, g = r~, J = dr~/dx,   H_L = I
//
// r~ and J are corrected for the robust losses as Ceres does [1, 2], so that
// J^T r~ is the exact gradient of L. Columns are tangent directions of the
// manifolds of the blocks that are not constant, in the order of
// problem.GetParameterBlocks(); rows follow the chosen residual blocks.
//
// Shapes:  m = sum of the residual sizes;  n = sum of the tangent sizes.
// Cost:    one CostFunction::Evaluate with Jacobians a residual block. Does not
//          use Problem::Evaluate, which must not be called during a solve.
// Fails:   Linearize and Cost return false if a cost function does or a value is
//          not finite; the message names the residual block by its index.
//
// [1] Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle Adjustment: A Modern
//     Synthesis. 1999, section 4.3.
// [2] ceres/internal/ceres/corrector.h.
#ifndef INVGRAD_SOLVE_PROBLEM_LINEARIZER_H_
#define INVGRAD_SOLVE_PROBLEM_LINEARIZER_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/linalg/linearization.h"

namespace invgrad {

class ProblemLinearizer {
 public:
  struct Options {
    // A mini-batch. Empty: all of the problem's residual blocks.
    std::vector<ceres::ResidualBlockId> residual_blocks;
    bool apply_loss_function = true;
  };

  // Reads the problem's structure once: blocks, manifolds and constness that
  // change later are not seen. The problem must outlive the linearizer.
  ProblemLinearizer(const ceres::Problem* problem, Options options);

  int num_residuals() const;   // m
  int num_parameters() const;  // n, tangent space
  int num_ambient() const;     // length of the state vector

  // The blocks that are not constant, in column order.
  const std::vector<double*>& parameter_blocks() const;
  // Where a block's columns begin.
  int column(int block) const;

  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const;
  bool Cost(double* cost, std::string* error) const;

  // The values of all blocks that are not constant, one after the other.
  Eigen::VectorXd State() const;
  void SetState(const Eigen::VectorXd& state) const;

  // Moves the problem by a tangent step (n), each block by its manifold's Plus.
  // False if a Plus fails; the blocks are then unchanged.
  bool Plus(const Eigen::VectorXd& step) const;
};

}  // namespace invgrad

#endif  // INVGRAD_SOLVE_PROBLEM_LINEARIZER_H_
