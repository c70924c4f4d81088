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
  double cost() const { return 0.5 * rho_[0]; }

  // |r~| / |r|
  double residual_scale() const { return residual_scale_; }

  // scale r, into the residual block's rows
  void WriteResiduals(double scale, double* scaled) const;

  // J~, into the residual block's rows of compressed values. False if a value
  // is not finite.
  bool WriteJacobian(double* values, std::string* error) const;

  // Adds the residual block's part of d2L/dx2. Its cost function must be a
  // SecondOrderCostFunction.
  bool AddHessian(Eigen::MatrixXd* hessian, std::string* error) const;

 private:
  using Argument = ProblemStructure::Argument;

  const Argument& ArgumentOf(int b) const {
    return structure_.arguments[block_->first_argument + b];
  }
  const RowMajorMatrix& PlusJacobian(int b) const {
    return (*plus_jacobians_)[ArgumentOf(b).block];
  }
  // dr/d(tangent of argument b), uncorrected.
  const RowMajorMatrix& Tangent(int b) const {
    return PlusJacobian(b).size() > 0 ? tangent_[b] : ambient_[b];
  }
  bool CorrectLoss(std::string* error);

  const ProblemStructure& structure_;
  const bool apply_loss_function_;
  const std::vector<RowMajorMatrix>* plus_jacobians_;
  const ResidualBlock* block_ = nullptr;
  Eigen::VectorXd r_;
  // dr/d(argument) for each argument that is not constant; and this matrix
  // times the PlusJacobian if there is a manifold.
  std::vector<RowMajorMatrix> ambient_;
  std::vector<RowMajorMatrix> tangent_;
  std::vector<double*> jacobians_;  // into ambient_; null: constant
  // rho, rho' and rho'', and the corrections of r and J.
  double rho_[3];
  double residual_scale_ = 1.0;
  double jacobian_scale_ = 1.0;
  double alpha_by_s_ = 0.0;  // alpha / s
};

// "residual block 3: `what`"
std::string ResidualBlockMessage(int index, const std::string& what);

}  // namespace invgrad

#endif  // INVGRAD_CERES_RESIDUAL_EVALUATION_H_
