// Evaluates the parts of L, r~, J and d2L/dx2 (problem_linearizer.h) of
// residual blocks, one after the other in the same memory.
//
//   r~ = sqrt(rho') / (1 - alpha) r
//   J~ = sqrt(rho') (J - alpha / s r r^T J),   s = |r|^2
//
// with alpha as in Triggs et al., section 4.3.
#ifndef INVGRAD_CERES_RESIDUAL_EVALUATION_H_
#define INVGRAD_CERES_RESIDUAL_EVALUATION_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {

// rho, rho' and rho'' of one residual block, and the corrections of r and J.
struct LossCorrection {
  double rho[3];
  double residual_scale = 1.0;
  double jacobian_scale = 1.0;
  double alpha_by_s = 0.0;  // alpha / s

  // False if no correction exists for these values.
  bool Compute(const ceres::LossFunction* loss_function, double s);
};

class ResidualEvaluation {
 public:
  using ResidualBlock = ProblemStructure::ResidualBlock;
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // `plus_jacobians` has one matrix for each parameter block, empty for a block
  // without manifold; null if no Jacobians are needed. Does not own its
  // arguments.
  ResidualEvaluation(const ProblemStructure& structure,
                     bool apply_loss_function,
                     const std::vector<RowMajorMatrix>* plus_jacobians)
      : structure_(structure),
        apply_loss_function_(apply_loss_function),
        plus_jacobians_(plus_jacobians) {}

  // Computes r, the tangent-space Jacobians (both uncorrected) and rho.
  bool Evaluate(const ResidualBlock& block, std::string* error);

  // The following functions refer to the last evaluated block.
  double cost() const { return 0.5 * correction_.rho[0]; }

  // r~
  void WriteResiduals(double* corrected) const;

  // J~, into the residual block's rows of compressed values.
  void WriteJacobian(const ResidualBlock& block, double* values) const;

  // Adds the residual block's part of d2L/dx2. Its cost function must be a
  // SecondOrderCostFunction.
  bool AddHessian(const ResidualBlock& block,
                  Eigen::MatrixXd* hessian,
                  std::string* error) const;

 private:
  using ParameterBlock = ProblemStructure::ParameterBlock;
  using Argument = ProblemStructure::Argument;

  const Argument& ArgumentOf(const ResidualBlock& block, int b) const {
    return structure_.arguments[block.first_argument + b];
  }
  Eigen::Map<const RowMajorMatrix> Tangent(const ResidualBlock& block,
                                           int b) const;
  bool Reserve(const ResidualBlock& block);
  void ToTangent(const ResidualBlock& block);
  Eigen::MatrixXd PullBack(int a, int b, const Eigen::MatrixXd& H) const;

  const ProblemStructure& structure_;
  const bool apply_loss_function_;
  const std::vector<RowMajorMatrix>* plus_jacobians_;
  Eigen::VectorXd r_;
  std::vector<double> memory_;
  // dr/d(argument) for each argument, null if it is constant; and this matrix
  // times the PlusJacobian (the same memory if there is no manifold).
  std::vector<double*> ambient_;
  std::vector<double*> tangent_;
  LossCorrection correction_;
};

// "residual block 3: `what`"
std::string ResidualBlockMessage(int index, const std::string& what);

}  // namespace invgrad

#endif  // INVGRAD_CERES_RESIDUAL_EVALUATION_H_
