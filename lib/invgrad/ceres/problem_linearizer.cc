#include "invgrad/ceres/problem_linearizer.h"

#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/residual_evaluation.h"
#include "invgrad/internal/logging.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/second_order_cost_function.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

// Whether Plus(x, d) = x + P d at x, for two steps d of size 1 without
// symmetry. Rotations and spheres differ by about 1 there, where rounding
// allows 1e-15.
bool PlusIsLinear(const ceres::Manifold& manifold,
                  const double* values,
                  const Eigen::MatrixXd& P) {
  const Eigen::Map<const Eigen::VectorXd> x(values, P.rows());
  Eigen::VectorXd d(P.cols());
  Eigen::VectorXd x_plus_d(P.rows());
  for (const double scale : {1.0, -0.37}) {
    for (Eigen::Index i = 0; i < d.size(); ++i) {
      d[i] = scale * (1.0 + std::sin(static_cast<double>(i + 1)));
    }
    if (!manifold.Plus(values, d.data(), x_plus_d.data())) return false;
    const double tolerance = 16.0 * std::numeric_limits<double>::epsilon() *
                             (x.norm() + (P * d).norm());
    if (!((x_plus_d - x - P * d).norm() <= tolerance)) return false;
  }
  return true;
}

}  // namespace

ProblemLinearizer::ProblemLinearizer(const ceres::Problem* problem,
                                     Options options)
    : options_(std::move(options)) {
  CHECK(problem != nullptr);
  structure_ = ReadStructure(*problem, options_.residual_blocks);
  residual_scales_.assign(structure_.residual_blocks.size(), 1.0);
}

bool ProblemLinearizer::PlusJacobians(std::vector<RowMajorMatrix>* jacobians,
                                      std::string* error) const {
  const std::vector<ParameterBlock>& blocks = structure_.parameter_blocks;
  jacobians->assign(blocks.size(), RowMajorMatrix());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (blocks[b].manifold == nullptr) continue;
    RowMajorMatrix& P = (*jacobians)[b];
    P.resize(blocks[b].ambient_size, blocks[b].tangent_size);
    if (!blocks[b].manifold->PlusJacobian(blocks[b].values, P.data())) {
      *error = fmt::format(
          "the PlusJacobian of parameter block {} (of those that are not "
          "constant) failed",
          b);
      return false;
    }
  }
  return true;
}

std::shared_ptr<SparseJacobian> ProblemLinearizer::NewJacobian() const {
  if (last_jacobian_ == nullptr) {
    last_jacobian_ = structure_.NewJacobian();
  } else if (last_jacobian_.use_count() != 1) {
    last_jacobian_ = std::make_shared<SparseJacobian>(*last_jacobian_);
  }
  return last_jacobian_;
}

bool ProblemLinearizer::CanComputeHessian(std::string* error) const {
  std::vector<RowMajorMatrix> P;
  if (!PlusJacobians(&P, error)) return false;
  const std::vector<ParameterBlock>& blocks = structure_.parameter_blocks;
  std::vector<bool> is_linear(blocks.size(), true);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (blocks[b].manifold != nullptr) {
      is_linear[b] = PlusIsLinear(*blocks[b].manifold, blocks[b].values, P[b]);
    }
  }
  for (const ResidualBlock& block : structure_.residual_blocks) {
    bool is_constant = true;
    for (int b = 0; b < block.num_arguments; ++b) {
      const int index = structure_.arguments[block.first_argument + b].block;
      if (index < 0) continue;
      is_constant = false;
      if (!is_linear[index]) {
        *error = ResidualBlockMessage(
            block.index,
            fmt::format(
                "no exact Hessian, because the manifold of its parameter block "
                "{} has a nonlinear Plus; use a rule that needs no Hessian, or "
                "no manifold, EuclideanManifold or SubsetManifold there",
                b));
        return false;
      }
    }
    if (!is_constant && dynamic_cast<const SecondOrderCostFunction*>(
                            block.cost_function) == nullptr) {
      *error = ResidualBlockMessage(
          block.index,
          "no exact Hessian, because its cost function is not a "
          "SecondOrderCostFunction; use AutoDiffSecondOrderCostFunction (it "
          "takes the same functor as ceres::AutoDiffCostFunction), or a rule "
          "that needs no Hessian");
      return false;
    }
  }
  return true;
}

bool ProblemLinearizer::Linearize(const LinearizationParts& parts,
                                  Linearization* linearization,
                                  std::string* error) const {
  CHECK(linearization != nullptr);
  CHECK(error != nullptr);
  const bool needs_jacobian = parts.gradient || parts.jacobian || parts.hessian;
  if (parts.hessian) {
    if (!CanComputeHessian(error)) return false;
    linearization->hessian.setZero(structure_.num_parameters,
                                   structure_.num_parameters);
  }
  std::vector<RowMajorMatrix> plus_jacobians;
  std::shared_ptr<SparseJacobian> jacobian;
  Eigen::VectorXd r;
  if (needs_jacobian) {
    if (!PlusJacobians(&plus_jacobians, error)) return false;
    jacobian = NewJacobian();
  }
  const bool needs_residuals = needs_jacobian || parts.loss_gradient;
  if (needs_residuals) r.resize(structure_.num_residuals);
  if (options_.evaluation_callback != nullptr) {
    options_.evaluation_callback->PrepareForEvaluation(
        needs_jacobian, /*new_evaluation_point=*/true);
  }
  double cost = 0.0;
  auto residual_scale = residual_scales_.begin();
  ResidualEvaluation evaluation(structure_,
                                options_.apply_loss_function,
                                needs_jacobian ? &plus_jacobians : nullptr);
  for (const ResidualBlock& block : structure_.residual_blocks) {
    double& scale = *residual_scale++;
    if (options_.leave_out_fixed && block.row_length == 0) {
      if (needs_residuals) r.segment(block.row, block.size).setZero();
      continue;
    }
    if (!evaluation.Evaluate(block, error)) return false;
    cost += evaluation.cost();
    if (needs_jacobian) scale = evaluation.residual_scale();
    if (needs_residuals) evaluation.WriteResiduals(scale, r.data() + block.row);
    if (!needs_jacobian) continue;
    if (!evaluation.WriteJacobian(
            jacobian->mutable_matrix()->valuePtr() +
                jacobian->matrix().outerIndexPtr()[block.row],
            error) ||
        (parts.hessian && block.row_length > 0 &&
         !evaluation.AddHessian(&linearization->hessian, error))) {
      return false;
    }
  }
  if (!std::isfinite(cost)) {
    *error = "the sum of the residual blocks' costs is not finite";
    return false;
  }
  linearization->cost = cost;
  if (!needs_jacobian) {
    if (parts.loss_gradient) linearization->loss_gradient = std::move(r);
    return true;
  }
  const SparseJacobian::Matrix& J = jacobian->matrix();
  if (parts.gradient) {
    linearization->gradient = J.transpose() * r;
    if (!linearization->gradient.allFinite()) {
      *error = "the gradient is not finite";
      return false;
    }
  }
  if (parts.hessian && !linearization->hessian.allFinite()) {
    *error = "the Hessian is not finite";
    return false;
  }
  if (parts.jacobian || parts.loss_gradient) {
    linearization->loss_gradient = std::move(r);
  }
  if (parts.jacobian) {
    if (IsDense(J.nonZeros(), J.rows(), J.cols())) {
      linearization->jacobian = std::make_shared<DenseJacobian>(
          Eigen::MatrixXd(J), structure_.tangent_sizes);
    } else {
      linearization->jacobian = jacobian;
    }
    linearization->loss_hessian_times = nullptr;  // the identity
    linearization->loss_on_curve = nullptr;
  }
  return true;
}

bool ProblemLinearizer::Cost(double* cost, std::string* error) const {
  CHECK(cost != nullptr);
  Linearization linearization;
  if (!Linearize({}, &linearization, error)) return false;
  *cost = linearization.cost;
  return true;
}

bool ProblemLinearizer::Plus(const Eigen::VectorXd& step) {
  Eigen::VectorXd state;
  if (!structure_.Plus(step, &state).empty()) return false;
  SetState(state);
  return true;
}

}  // namespace invgrad
