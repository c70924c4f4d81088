// Linearizes any ceres::Problem at the current values of its parameter blocks.
//
//   L = 1/2 sum_b rho_b(|r_b|^2),   y = r~, g = r~, J = dr~/dx,   H_L = I
//
// r~ and J are corrected for the robust losses as Ceres does [1, 2], so that
// J^T r~ is the exact gradient of L. Rows follow the chosen residual blocks.
// Columns are tangent directions of the manifolds of the blocks that are not
// constant, in the order in which the problem's residual blocks first name
// them; blocks that none names come last, with columns of zeros. (The order of
// Problem::GetParameterBlocks is that of the addresses, so it would make runs
// irreproducible.)
//
// Shapes:  m = sum of the residual sizes;  n = sum of the tangent sizes.
// J is a SparseJacobian, or a DenseJacobian if at least half of it is filled;
// its ColumnBlocks are the parameter blocks that are not constant.
// Cost:    one CostFunction::Evaluate with Jacobians a residual block. Does not
//          use Problem::Evaluate, which must not be called during a solve.
// Fails:   Linearize and Cost return false if a cost function does or a value
//          is not finite (finite residuals can overflow when squared); the
//          message names the residual block by its index in the problem.
//
// The exact Hessian, in tangent directions, includes the robust losses:
//
//   H = sum_b rho' (J^T J + sum_i r_i d2r_i/dx2) + 2 rho'' (J^T r) (J^T r)^T
//
// with the uncorrected r and J. It needs every cost function to be a
// SecondOrderCostFunction (second_order_cost_function.h) and every Plus to be
// linear: no manifold, EuclideanManifold, SubsetManifold, and what else passes
// a numerical check that Plus(x, d) = x + P d. Where Plus is curved its second
// derivative is part of the Hessian, and Ceres' manifolds do not offer it;
// Linearize then returns false and says which block is to blame.
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
#include "ceres/cost_function.h"
#include "ceres/evaluation_callback.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/core/linearization.h"
#include "invgrad/core/objective.h"

namespace invgrad {

class ProblemLinearizer final : public Objective {
 public:
  struct Options {
    // A mini-batch. Empty: all of the problem's residual blocks.
    std::vector<ceres::ResidualBlockId> residual_blocks;
    bool apply_loss_function = true;
    // The problem's own, which Ceres 2.1 does not let anyone ask for. Prepared
    // before every evaluation, except inside ceres::Solve, which has done it:
    // leave it null there. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
  };

  // Reads the problem's structure once: blocks, manifolds and constness that
  // change later are not seen. The problem must outlive the linearizer.
  ProblemLinearizer(const ceres::Problem* problem, Options options);

  int num_residuals() const { return num_residuals_; }  // m
  // n, tangent space
  int num_parameters() const override { return num_parameters_; }
  int num_ambient() const { return num_ambient_; }  // length of the state

  // The blocks that are not constant, in column order.
  const std::vector<double*>& parameter_blocks() const {
    return parameter_blocks_;
  }
  // Where the columns of parameter_blocks()[block] begin.
  int column(int block) const { return blocks_[block].column; }
  int ambient_size(int block) const { return blocks_[block].ambient_size; }
  int tangent_size(int block) const { return blocks_[block].tangent_size; }
  // Null: Euclidean.
  const ceres::Manifold* manifold(int block) const {
    return blocks_[block].manifold;
  }

  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override;

  // The values of all blocks that are not constant, one after the other.
  Eigen::VectorXd State() const override;
  void SetState(const Eigen::VectorXd& state) override;

  // Moves the problem by a tangent step (n), each block by its manifold's Plus.
  // False if a Plus fails; the blocks are then unchanged.
  bool Plus(const Eigen::VectorXd& step) override;

 private:
  // A parameter block that is not constant.
  struct ParameterBlock {
    double* values;
    int ambient_size;
    int tangent_size;
    int column;                       // of J
    int offset;                       // in the state
    const ceres::Manifold* manifold;  // null: Euclidean
  };

  struct ResidualBlock {
    const ceres::CostFunction* cost_function;
    const ceres::LossFunction* loss_function;  // may be null
    int index;                                 // in the problem
    int row;
    int size;
    int first_argument;  // its parameter blocks, in values_ and arguments_
    int num_arguments;
    int row_length;  // of its rows in compressed form
  };

  // A parameter block of a residual block.
  struct Argument {
    int block;  // of blocks_; -1: constant
    // Where its entries begin in a compressed row of the residual block;
    // entries are sorted by column.
    int entry;
  };

  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  class Reader;  // of the problem's structure
  // One residual block's part of a linearization.
  class BlockEvaluation;

  std::shared_ptr<SparseJacobian> NewSparsity() const;
  std::shared_ptr<SparseJacobian> NewJacobian() const;
  std::string NotFinite(const SparseJacobian::Matrix& J) const;
  void Prepare(bool evaluate_jacobians) const;
  bool PlusJacobians(std::vector<RowMajorMatrix>* jacobians,
                     std::string* error) const;
  bool CanComputeHessian(std::string* error) const;

  Options options_;
  int num_residuals_ = 0;
  int num_parameters_ = 0;
  int num_ambient_ = 0;
  std::vector<double*> parameter_blocks_;
  std::vector<ParameterBlock> blocks_;
  std::vector<ResidualBlock> residual_blocks_;
  std::vector<double*> values_;      // of all residual blocks' arguments
  std::vector<Argument> arguments_;  // the same
  std::vector<int> tangent_sizes_;   // of blocks_
  // The last J, whose memory the next one takes over if nobody else holds it,
  // and whose pattern it has in any case. Null before the first.
  mutable std::shared_ptr<SparseJacobian> last_jacobian_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_PROBLEM_LINEARIZER_H_
