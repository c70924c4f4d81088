// Linearizes a ceres::Problem at the current values of its parameter blocks.
//
//   L = 1/2 sum_b rho_b(|r_b|^2),   y = r~, g = r~, J = dr~/dx,   H_L = I
//
// r~ and J are corrected for the robust losses as Ceres does [1, 2], so that
// J^T r~ is the exact gradient of L. A g without J, which is that of a trial
// step, has the weights of the last J, so that differences of g are those of
// the reweighted problem that J belongs to (where rho'' <= 0, as all losses of
// Ceres but TolerantLoss have it). Rows and columns are in the order of
// problem_structure.h; unused parameter blocks have columns of zeros.
//
// Shapes:  m = sum of the residual sizes;  n = sum of the tangent sizes.
// J is a SparseJacobian, or a DenseJacobian if at least half of it is filled;
// its ColumnBlocks are the parameter blocks that are not constant.
// Cost:    one CostFunction::Evaluate with Jacobians per residual block. Does
//          not call Problem::Evaluate, which is not allowed during a solve.
// Fails:   Linearize and Cost return false if a cost function does or a value
//          is not finite (finite residuals can overflow when squared); the
//          message names the residual block by its index in the problem.
//
// The exact Hessian, in tangent directions, with the uncorrected r and J:
//
//   H = sum_b rho' (J^T J + sum_i r_i d2r_i/dx2) + 2 rho'' (J^T r) (J^T r)^T
//
// It needs every cost function to be a SecondOrderCostFunction
// (second_order_cost_function.h), and every Plus to be linear by a numerical
// check, because Ceres' manifolds do not compute the second derivatives of Plus.
// Otherwise Linearize returns false and names the block.
//
// [1] Triggs, McLauchlan, Hartley, Fitzgibbon. Bundle Adjustment: A Modern
//     Synthesis. 1999, section 4.3.
// [2] Ceres Solver 2.1, internal/ceres/corrector.{h,cc}.
#ifndef INVGRAD_CERES_PROBLEM_LINEARIZER_H_
#define INVGRAD_CERES_PROBLEM_LINEARIZER_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/internal/objective.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {

class ProblemLinearizer final : public Objective {
 public:
  struct Options {
    // A mini-batch. Empty: all of the problem's residual blocks.
    std::vector<ceres::ResidualBlockId> residual_blocks;
    bool apply_loss_function = true;
    // The evaluation callback of the problem, which Ceres 2.1 does not expose.
    // It is called before every evaluation. Leave it null inside ceres::Solve,
    // which calls the callback itself. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
    // Residual blocks whose parameter blocks are all constant: no cost, and
    // r = 0. Ceres leaves their cost out of all decisions.
    bool leave_out_fixed = false;
  };

  // Reads the problem's structure once; later changes of blocks, manifolds and
  // constness have no effect. The problem must outlive the linearizer.
  ProblemLinearizer(const ceres::Problem* problem, Options options);

  const ProblemStructure& structure() const { return structure_; }
  // n, tangent space
  int num_parameters() const override { return structure_.num_parameters; }

  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override;

  // The values of all blocks that are not constant, one after the other.
  Eigen::VectorXd State() const override { return structure_.State(); }
  void SetState(const Eigen::VectorXd& state) override {
    structure_.SetState(state);
  }

  // Moves the problem by a tangent step (n), each block by the Plus of its
  // manifold. Returns false, and leaves the blocks unchanged, if a Plus fails.
  bool Plus(const Eigen::VectorXd& step) override;

 private:
  using ParameterBlock = ProblemStructure::ParameterBlock;
  using ResidualBlock = ProblemStructure::ResidualBlock;
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  std::shared_ptr<SparseJacobian> NewJacobian() const;
  bool PlusJacobians(std::vector<RowMajorMatrix>* jacobians,
                     std::string* error) const;
  bool CanComputeHessian(std::string* error) const;

  Options options_;
  ProblemStructure structure_;
  // The last J, or null. The next J has the same pattern, and reuses the memory
  // if there is no other reference to it.
  mutable std::shared_ptr<SparseJacobian> last_jacobian_;
  // |r~| / |r| of the residual blocks at the last J; 1 before there is one
  mutable std::vector<double> residual_scales_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_PROBLEM_LINEARIZER_H_
