// The structure of a ceres::Problem: the parameter blocks of each residual
// block, and their columns in the Jacobian.
//
// Rows follow the residual blocks. Columns are the tangent directions of the
// parameter blocks that are not constant, in the order in which the residual
// blocks first use them; unused blocks come last. (Problem::GetParameterBlocks
// sorts by address, which differs from run to run.)
#ifndef INVGRAD_CERES_PROBLEM_STRUCTURE_H_
#define INVGRAD_CERES_PROBLEM_STRUCTURE_H_

#include <cstdint>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {

struct ProblemStructure {
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
    int first_argument;  // its parameter blocks, in `values` and `arguments`
    int num_arguments;
    int row_length;  // of its rows in compressed form
  };

  // A parameter block of a residual block.
  struct Argument {
    int block;  // of parameter_blocks; -1: constant
    // The position of its first entry in a compressed row of the residual
    // block; entries are sorted by column.
    int entry;
  };

  int num_residuals = 0;   // m
  int num_parameters = 0;  // n, tangent space
  int num_ambient = 0;     // length of the state
  // Of the residual blocks that depend on a parameter that is not constant.
  int num_variable_residuals = 0;
  std::int64_t num_entries = 0;  // of J
  std::vector<ParameterBlock> parameter_blocks;
  std::vector<ResidualBlock> residual_blocks;
  std::vector<double*> values;      // of all residual blocks' arguments
  std::vector<Argument> arguments;  // the same
  std::vector<int> tangent_sizes;   // of parameter_blocks

  // The values of parameter_blocks, one after the other.
  Eigen::VectorXd State() const;
  void SetState(const Eigen::VectorXd& state) const;
  // The state after a tangent step (n), each block by the Plus of its manifold.
  // Changes no block. Returns the blocks whose Plus fails, in their order.
  std::vector<int> Plus(const Eigen::VectorXd& step,
                        Eigen::VectorXd* state) const;

  // m x n, with the pattern of J and unspecified entries. CHECKs that the
  // number of entries fits an int.
  std::shared_ptr<SparseJacobian> NewJacobian() const;
};

// Whether a J with so many entries is stored as a dense matrix: with most of them
// not zero BLAS is faster.
inline bool IsDense(double num_entries, double rows, double cols) {
  constexpr double kShare = 0.5;
  return num_entries >= kShare * rows * cols;
}

// The structure for the residual blocks in `batch` (CHECKed to belong to the
// problem), or for all of them if `batch` is empty.
ProblemStructure ReadStructure(
    const ceres::Problem& problem,
    const std::vector<ceres::ResidualBlockId>& batch);

}  // namespace invgrad

#endif  // INVGRAD_CERES_PROBLEM_STRUCTURE_H_
