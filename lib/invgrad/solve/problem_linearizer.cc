#include "invgrad/solve/problem_linearizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "glog/logging.h"
#include "invgrad/solve/second_order_cost_function.h"

namespace invgrad {
namespace {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::string BlockMessage(int index, const std::string& what) {
  return "residual block " + std::to_string(index) + ": " + what;
}

std::vector<double*> BlocksInOrderOfUse(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  std::unordered_set<const double*> seen;
  const auto add_new = [&](const std::vector<double*>& candidates) {
    for (double* values : candidates) {
      if (seen.insert(values).second) blocks.push_back(values);
    }
  };
  std::vector<ceres::ResidualBlockId> residual_blocks;
  problem.GetResidualBlocks(&residual_blocks);
  std::vector<double*> of_residual_block;
  for (const ceres::ResidualBlockId id : residual_blocks) {
    problem.GetParameterBlocksForResidualBlock(id, &of_residual_block);
    add_new(of_residual_block);
  }
  std::vector<double*> all;
  problem.GetParameterBlocks(&all);
  add_new(all);
  return blocks;
}

// rho, rho' and rho'' of one residual block and what they do to r and J.
struct Correction {
  double rho[3];
  double residual_scale = 1.0;
  double jacobian_scale = 1.0;
  double alpha_by_s = 0.0;  // alpha / s

  // s = |r|^2. False if the loss function cannot be corrected for.
  bool Compute(const ceres::LossFunction* loss_function, double s) {
    if (loss_function == nullptr) {
      rho[0] = s;
      rho[1] = 1.0;
      rho[2] = 0.0;
      return true;
    }
    loss_function->Evaluate(s, rho);
    if (!(rho[1] >= 0.0)) return false;
    jacobian_scale = std::sqrt(rho[1]);
    residual_scale = jacobian_scale;
    // As Ceres [2]: the second-order correction only where rho'' > 0. It is
    // left out for outliers, where Ceres' authors found that it slows
    // convergence down; J^T r~ is the exact gradient with and without it.
    if (s == 0.0 || rho[2] <= 0.0) return true;
    if (rho[1] == 0.0) return false;
    // The smaller root of alpha^2 / 2 - alpha - s rho'' / rho' = 0 [1].
    const double alpha = 1.0 - std::sqrt(1.0 + 2.0 * s * rho[2] / rho[1]);
    residual_scale = jacobian_scale / (1.0 - alpha);
    alpha_by_s = alpha / s;
    return true;
  }
};

// Whether Plus(x, d) = x + P d at x. The probes are of the size of 1 and have
// no symmetry, so that a curved Plus gives itself away: rotations and spheres
// do by about 1 where rounding allows 1e-15.
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

// Evaluates one residual block after the other in the same memory.
class ProblemLinearizer::BlockEvaluation {
 public:
  // `plus_jacobians` is null if no Jacobians are wanted.
  BlockEvaluation(const ProblemLinearizer& linearizer,
                  const std::vector<Eigen::MatrixXd>* plus_jacobians)
      : linearizer_(linearizer), plus_jacobians_(plus_jacobians) {}

  // Computes r, the tangent-space Jacobians (both uncorrected) and rho.
  bool Evaluate(const ResidualBlock& block, std::string* error) {
    r_.resize(block.size);
    const int num_blocks = static_cast<int>(block.blocks.size());
    ambient_.resize(num_blocks);
    jacobian_pointers_.assign(num_blocks, nullptr);
    bool any_jacobian = false;
    for (int b = 0; b < num_blocks; ++b) {
      if (plus_jacobians_ == nullptr || block.blocks[b] < 0) continue;
      const ParameterBlock& parameters = linearizer_.blocks_[block.blocks[b]];
      ambient_[b].resize(block.size, parameters.ambient_size);
      jacobian_pointers_[b] = ambient_[b].data();
      any_jacobian = true;
    }
    if (!block.cost_function->Evaluate(
            block.parameters.data(),
            r_.data(),
            any_jacobian ? jacobian_pointers_.data() : nullptr)) {
      *error = BlockMessage(block.index, "the cost function returned false");
      return false;
    }
    if (!r_.allFinite()) {
      *error = BlockMessage(block.index, "a residual is not finite");
      return false;
    }
    if (any_jacobian && !ToTangent(block, error)) return false;
    correction_ = Correction();
    const ceres::LossFunction* loss_function =
        linearizer_.options_.apply_loss_function ? block.loss_function
                                                 : nullptr;
    if (!correction_.Compute(loss_function, r_.squaredNorm())) {
      *error = BlockMessage(block.index,
                            "the loss function needs rho' >= 0, and rho' > 0 "
                            "where rho'' > 0");
      return false;
    }
    if (!std::isfinite(correction_.rho[0])) {
      *error = BlockMessage(block.index, "the cost is not finite");
      return false;
    }
    return true;
  }

  double cost() const { return 0.5 * correction_.rho[0]; }

  Eigen::VectorXd CorrectedResiduals() const {
    return correction_.residual_scale * r_;
  }

  // sqrt(rho') (J - alpha / s r r^T J), block b of the residual block.
  RowMajorMatrix CorrectedJacobian(int b) const {
    RowMajorMatrix J = correction_.jacobian_scale * tangent_[b];
    if (correction_.alpha_by_s != 0.0) {
      J -= correction_.alpha_by_s * r_ * (r_.transpose() * J).eval();
    }
    return J;
  }

  // Adds the residual block's part of d2L/dx2.
  bool AddHessian(const ResidualBlock& block,
                  Eigen::MatrixXd* hessian,
                  std::string* error) const {
    const auto* cost_function =
        dynamic_cast<const SecondOrderCostFunction*>(block.cost_function);
    const std::vector<int>& sizes = cost_function->parameter_block_sizes();
    const int n = std::accumulate(sizes.begin(), sizes.end(), 0);
    Eigen::MatrixXd second(n, n);  // sum_i rho' r_i d2r_i/dx2, ambient
    const Eigen::VectorXd w = correction_.rho[1] * r_;
    if (!cost_function->WeightedHessian(
            block.parameters.data(), w.data(), second.data())) {
      *error = BlockMessage(block.index, "WeightedHessian returned false");
      return false;
    }
    int row = 0;
    for (std::size_t a = 0; a < sizes.size(); row += sizes[a++]) {
      if (block.blocks[a] < 0) continue;
      int col = 0;
      for (std::size_t b = 0; b < sizes.size(); col += sizes[b++]) {
        if (block.blocks[b] < 0) continue;
        const RowMajorMatrix& J_a = tangent_[a];
        const RowMajorMatrix& J_b = tangent_[b];
        hessian->block(linearizer_.blocks_[block.blocks[a]].column,
                       linearizer_.blocks_[block.blocks[b]].column,
                       J_a.cols(),
                       J_b.cols()) +=
            PullBack(block.blocks[a],
                     block.blocks[b],
                     second.block(row, col, sizes[a], sizes[b])) +
            correction_.rho[1] * J_a.transpose() * J_b +
            2.0 * correction_.rho[2] * (J_a.transpose() * r_) *
                (J_b.transpose() * r_).transpose();
      }
    }
    return true;
  }

 private:
  bool ToTangent(const ResidualBlock& block, std::string* error) {
    tangent_.resize(block.blocks.size());
    for (std::size_t b = 0; b < block.blocks.size(); ++b) {
      if (block.blocks[b] < 0) continue;
      const Eigen::MatrixXd& P = (*plus_jacobians_)[block.blocks[b]];
      if (P.size() > 0) {
        tangent_[b].noalias() = ambient_[b] * P;
      } else {
        tangent_[b] = ambient_[b];
      }
      if (!tangent_[b].allFinite()) {
        *error = BlockMessage(block.index,
                              "its Jacobian by parameter block " +
                                  std::to_string(b) + " is not finite");
        return false;
      }
    }
    return true;
  }

  // P_a^T H P_b.
  Eigen::MatrixXd PullBack(int a, int b, const Eigen::MatrixXd& H) const {
    const Eigen::MatrixXd& P_a = (*plus_jacobians_)[a];
    const Eigen::MatrixXd& P_b = (*plus_jacobians_)[b];
    Eigen::MatrixXd result = P_a.size() > 0 ? P_a.transpose() * H : H;
    if (P_b.size() > 0) result = result * P_b;
    return result;
  }

  const ProblemLinearizer& linearizer_;
  // One a parameter block; empty where it has no manifold.
  const std::vector<Eigen::MatrixXd>* plus_jacobians_;
  Eigen::VectorXd r_;
  std::vector<RowMajorMatrix> ambient_;  // dr/d(parameters), one a block
  std::vector<double*> jacobian_pointers_;
  std::vector<RowMajorMatrix> tangent_;  // the same times P
  Correction correction_;
};

ProblemLinearizer::ProblemLinearizer(const ceres::Problem* problem,
                                     Options options)
    : options_(std::move(options)) {
  CHECK(problem != nullptr);
  AddParameterBlocks(*problem);
  AddResidualBlocks(*problem);
  BuildSparsity();
}

void ProblemLinearizer::AddParameterBlocks(const ceres::Problem& problem) {
  for (double* values : BlocksInOrderOfUse(problem)) {
    if (problem.IsParameterBlockConstant(values)) continue;
    const ParameterBlock block = {values,
                                  problem.ParameterBlockSize(values),
                                  problem.ParameterBlockTangentSize(values),
                                  num_parameters_,
                                  num_ambient_,
                                  problem.GetManifold(values)};
    parameter_blocks_.push_back(values);
    blocks_.push_back(block);
    num_parameters_ += block.tangent_size;
    num_ambient_ += block.ambient_size;
  }
}

void ProblemLinearizer::AddResidualBlocks(const ceres::Problem& problem) {
  std::unordered_map<const double*, int> block_of;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    block_of[blocks_[i].values] = static_cast<int>(i);
  }
  std::vector<ceres::ResidualBlockId> all;
  problem.GetResidualBlocks(&all);
  std::unordered_map<ceres::ResidualBlockId, int> index_of;
  for (std::size_t i = 0; i < all.size(); ++i) {
    index_of[all[i]] = static_cast<int>(i);
  }
  const std::vector<ceres::ResidualBlockId>& chosen =
      options_.residual_blocks.empty() ? all : options_.residual_blocks;
  for (const ceres::ResidualBlockId id : chosen) {
    CHECK(index_of.count(id) > 0)
        << "A residual block of the mini-batch is not part of the problem.";
    ResidualBlock block;
    block.cost_function = problem.GetCostFunctionForResidualBlock(id);
    block.loss_function = problem.GetLossFunctionForResidualBlock(id);
    block.index = index_of[id];
    block.row = num_residuals_;
    block.size = block.cost_function->num_residuals();
    problem.GetParameterBlocksForResidualBlock(id, &block.parameters);
    for (const double* values : block.parameters) {
      const auto it = block_of.find(values);
      block.blocks.push_back(it == block_of.end() ? -1 : it->second);
    }
    num_residuals_ += block.size;
    residual_blocks_.push_back(std::move(block));
  }
}

void ProblemLinearizer::BuildSparsity() {
  std::vector<int> row_starts = {0};
  std::vector<int> columns;
  for (ResidualBlock& block : residual_blocks_) {
    block.entry.assign(block.blocks.size(), 0);
    std::vector<int> order;
    for (std::size_t b = 0; b < block.blocks.size(); ++b) {
      if (block.blocks[b] >= 0) order.push_back(static_cast<int>(b));
    }
    std::sort(order.begin(), order.end(), [&block](int a, int b) {
      return block.blocks[a] < block.blocks[b];
    });
    std::vector<int> row;
    for (const int b : order) {
      const ParameterBlock& parameters = blocks_[block.blocks[b]];
      block.entry[b] = static_cast<int>(row.size());
      for (int i = 0; i < parameters.tangent_size; ++i) {
        row.push_back(parameters.column + i);
      }
    }
    for (int i = 0; i < block.size; ++i) {
      columns.insert(columns.end(), row.begin(), row.end());
      row_starts.push_back(static_cast<int>(columns.size()));
    }
  }
  sparsity_.resize(num_residuals_, num_parameters_);
  sparsity_.resizeNonZeros(static_cast<int>(columns.size()));
  std::copy(row_starts.begin(), row_starts.end(), sparsity_.outerIndexPtr());
  std::copy(columns.begin(), columns.end(), sparsity_.innerIndexPtr());
  std::fill_n(sparsity_.valuePtr(), columns.size(), 0.0);
}

void ProblemLinearizer::Prepare(bool evaluate_jacobians) const {
  if (options_.evaluation_callback != nullptr) {
    options_.evaluation_callback->PrepareForEvaluation(
        evaluate_jacobians, /*new_evaluation_point=*/true);
  }
}

bool ProblemLinearizer::PlusJacobians(std::vector<Eigen::MatrixXd>* jacobians,
                                      std::string* error) const {
  jacobians->assign(blocks_.size(), Eigen::MatrixXd());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].manifold == nullptr) continue;
    RowMajorMatrix P(blocks_[b].ambient_size, blocks_[b].tangent_size);
    if (!blocks_[b].manifold->PlusJacobian(blocks_[b].values, P.data())) {
      *error = "the PlusJacobian of parameter block " + std::to_string(b) +
               " (of those that are not constant) failed";
      return false;
    }
    (*jacobians)[b] = P;
  }
  return true;
}

bool ProblemLinearizer::CanComputeHessian(std::string* error) const {
  std::vector<Eigen::MatrixXd> P;
  if (!PlusJacobians(&P, error)) return false;
  std::vector<bool> is_linear(blocks_.size(), true);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].manifold != nullptr) {
      is_linear[b] =
          PlusIsLinear(*blocks_[b].manifold, blocks_[b].values, P[b]);
    }
  }
  for (const ResidualBlock& block : residual_blocks_) {
    bool is_constant = true;
    for (std::size_t b = 0; b < block.blocks.size(); ++b) {
      if (block.blocks[b] < 0) continue;
      is_constant = false;
      if (!is_linear[block.blocks[b]]) {
        *error = BlockMessage(
            block.index,
            "no exact Hessian, because the manifold of its parameter block " +
                std::to_string(b) +
                " has a curved Plus; use a rule that needs no Hessian, or no "
                "manifold, EuclideanManifold or SubsetManifold there");
        return false;
      }
    }
    if (!is_constant && dynamic_cast<const SecondOrderCostFunction*>(
                            block.cost_function) == nullptr) {
      *error = BlockMessage(
          block.index,
          "no exact Hessian, because its cost function is no "
          "SecondOrderCostFunction; make it an "
          "AutoDiffSecondOrderCostFunction (it takes the same functor as "
          "ceres::AutoDiffCostFunction), or use a rule that needs no Hessian");
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
  if (!needs_jacobian) return Cost(&linearization->cost, error);

  if (parts.hessian) {
    if (!CanComputeHessian(error)) return false;
    linearization->hessian.setZero(num_parameters_, num_parameters_);
  }
  std::vector<Eigen::MatrixXd> plus_jacobians;
  if (!PlusJacobians(&plus_jacobians, error)) return false;
  SparseJacobian::Matrix J = sparsity_;
  Eigen::VectorXd r(num_residuals_);
  double cost = 0.0;
  Prepare(/*evaluate_jacobians=*/true);
  BlockEvaluation evaluation(*this, &plus_jacobians);
  for (const ResidualBlock& block : residual_blocks_) {
    if (!evaluation.Evaluate(block, error)) return false;
    cost += evaluation.cost();
    r.segment(block.row, block.size) = evaluation.CorrectedResiduals();
    bool is_constant = true;
    for (std::size_t b = 0; b < block.blocks.size(); ++b) {
      if (block.blocks[b] < 0) continue;
      is_constant = false;
      const RowMajorMatrix J_b =
          evaluation.CorrectedJacobian(static_cast<int>(b));
      for (int i = 0; i < block.size; ++i) {
        const int row_start = J.outerIndexPtr()[block.row + i];
        std::copy_n(J_b.row(i).data(),
                    J_b.cols(),
                    J.valuePtr() + row_start + block.entry[b]);
      }
    }
    if (parts.hessian && !is_constant &&
        !evaluation.AddHessian(block, &linearization->hessian, error)) {
      return false;
    }
  }
  if (!std::isfinite(cost)) {
    *error = "the sum of the residual blocks' costs is not finite";
    return false;
  }
  linearization->cost = cost;
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
  if (parts.jacobian) {
    linearization->loss_gradient = std::move(r);
    // Products with a matrix that is mostly full are BLAS' work.
    constexpr double kDense = 0.5;
    std::vector<int> block_sizes;
    for (const ParameterBlock& block : blocks_) {
      block_sizes.push_back(block.tangent_size);
    }
    if (static_cast<double>(J.nonZeros()) >=
        kDense * static_cast<double>(J.rows()) *
            static_cast<double>(J.cols())) {
      linearization->jacobian =
          std::make_shared<DenseJacobian>(Eigen::MatrixXd(J), block_sizes);
    } else {
      linearization->jacobian =
          std::make_shared<SparseJacobian>(std::move(J), block_sizes);
    }
    linearization->loss_hessian_times = nullptr;  // the identity
  }
  return true;
}

bool ProblemLinearizer::Cost(double* cost, std::string* error) const {
  CHECK(cost != nullptr);
  CHECK(error != nullptr);
  double sum = 0.0;
  Prepare(/*evaluate_jacobians=*/false);
  BlockEvaluation evaluation(*this, nullptr);
  for (const ResidualBlock& block : residual_blocks_) {
    if (!evaluation.Evaluate(block, error)) return false;
    sum += evaluation.cost();
  }
  if (!std::isfinite(sum)) {
    *error = "the sum of the residual blocks' costs is not finite";
    return false;
  }
  *cost = sum;
  return true;
}

Eigen::VectorXd ProblemLinearizer::State() const {
  Eigen::VectorXd state(num_ambient_);
  for (const ParameterBlock& block : blocks_) {
    std::copy_n(block.values, block.ambient_size, state.data() + block.offset);
  }
  return state;
}

void ProblemLinearizer::SetState(const Eigen::VectorXd& state) {
  CHECK_EQ(state.size(), num_ambient_);
  for (const ParameterBlock& block : blocks_) {
    std::copy_n(state.data() + block.offset, block.ambient_size, block.values);
  }
}

bool ProblemLinearizer::Plus(const Eigen::VectorXd& step) {
  CHECK_EQ(step.size(), num_parameters_);
  Eigen::VectorXd state = State();
  for (const ParameterBlock& block : blocks_) {
    if (block.manifold == nullptr) {
      state.segment(block.offset, block.ambient_size) +=
          step.segment(block.column, block.tangent_size);
    } else if (!block.manifold->Plus(block.values,
                                     step.data() + block.column,
                                     state.data() + block.offset)) {
      return false;
    }
  }
  SetState(state);
  return true;
}

}  // namespace invgrad
