// The residual blocks that share linear parameters, as one function of these
// and of the other parameters.
//
//   r(alpha, c),   A = dr/dalpha,   Phi = dr/dc
//
// A parameter block may hold parameters of both kinds. Its columns of A are
// those of the whole block, with zeros for the linear parameters.
//
// Shapes:  r: m;  c: p;  A: m x n, ambient;  Phi: m x p.
// Fails:   Evaluate returns false if a cost function does or a value is not
//          finite; the message names the residual block by its index in the
//          problem.
// Threads: one at a time.
#ifndef INVGRAD_SEPARABLE_COMPONENT_RESIDUALS_H_
#define INVGRAD_SEPARABLE_COMPONENT_RESIDUALS_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "ceres/loss_function.h"

namespace invgrad {

class ComponentResiduals {
 public:
  struct Block {
    double* values;  // the user's
    int size;
    int index;  // of ProblemStructure::parameter_blocks; -1: constant
    // Of alpha: the block's number, and its first column of A; -1: none of its
    // parameters is both nonlinear and variable.
    int argument = -1;
    int column = -1;
    // The column of Phi of each parameter, -1 if it is not linear; empty: none.
    std::vector<int> linear;
  };

  struct ResidualBlock {
    const ceres::CostFunction* cost_function;
    const ceres::LossFunction* loss_function;  // may be null
    int index;                                 // in the problem
    int row;
    int size;
    std::vector<int> blocks;  // of blocks()
  };

  // A linear parameter: the component `component` of blocks()[block].
  struct Parameter {
    int block;
    int component;
  };

  // Returns the index of the block, which is added once. `is_linear` has an
  // entry for each of its parameters.
  int AddBlock(double* values,
               int size,
               int index,
               const std::vector<bool>& is_linear);
  void AddResidualBlock(const ceres::CostFunction* cost_function,
                        const ceres::LossFunction* loss_function,
                        int index,
                        const std::vector<int>& blocks);

  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<ResidualBlock>& residual_blocks() const {
    return residual_blocks_;
  }
  const std::vector<int>& arguments() const { return arguments_; }  // blocks
  int num_residuals() const { return num_residuals_; }              // m
  int num_columns() const { return num_columns_; }                  // n
  int num_linear() const { return static_cast<int>(linear_.size()); }
  const std::vector<Parameter>& linear() const { return linear_; }
  bool has_loss() const { return has_loss_; }

  // alpha: the values of arguments(). A and Phi may be null, both or one.
  bool Evaluate(const double* const* alpha,
                const Eigen::VectorXd& c,
                Eigen::VectorXd* r,
                Eigen::MatrixXd* A,
                Eigen::MatrixXd* Phi,
                std::string* error) const;

  // The user's values.
  std::vector<const double*> Alpha() const;
  Eigen::VectorXd Linear() const;
  void SetLinear(const Eigen::VectorXd& c) const;

 private:
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  bool EvaluateBlock(const ResidualBlock& block,
                     Eigen::VectorXd* r,
                     Eigen::MatrixXd* A,
                     Eigen::MatrixXd* Phi,
                     std::string* error) const;

  std::vector<Block> blocks_;
  std::vector<ResidualBlock> residual_blocks_;
  std::vector<int> arguments_;
  std::vector<Parameter> linear_;
  int num_residuals_ = 0;
  int num_columns_ = 0;
  bool has_loss_ = false;
  // Memory of Evaluate: the values of blocks(), those of blocks with linear
  // parameters with c, and the arguments of a residual block.
  mutable std::vector<const double*> values_;
  mutable std::vector<Eigen::VectorXd> with_c_;
  mutable std::vector<const double*> parameters_;
  mutable std::vector<RowMajorMatrix> J_;
  mutable std::vector<double*> jacobians_;
};

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_COMPONENT_RESIDUALS_H_
