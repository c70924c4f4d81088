#include "invgrad/ceres/problem_linearizer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "glog/logging.h"
#include "invgrad/ceres/second_order_cost_function.h"

namespace invgrad {
namespace {

std::string BlockMessage(int index, const std::string& what) {
  return "residual block " + std::to_string(index) + ": " + what;
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
                  const std::vector<RowMajorMatrix>* plus_jacobians)
      : linearizer_(linearizer), plus_jacobians_(plus_jacobians) {}

  // Computes r, the tangent-space Jacobians (both uncorrected) and rho.
  bool Evaluate(const ResidualBlock& block, std::string* error) {
    r_.resize(block.size);
    const bool any_jacobian = plus_jacobians_ != nullptr && Reserve(block);
    double* const* values = linearizer_.values_.data() + block.first_argument;
    if (!block.cost_function->Evaluate(
            values, r_.data(), any_jacobian ? ambient_.data() : nullptr)) {
      *error = BlockMessage(block.index, "the cost function returned false");
      return false;
    }
    if (!r_.allFinite()) {
      *error = BlockMessage(block.index, "a residual is not finite");
      return false;
    }
    if (any_jacobian) ToTangent(block);
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

  // sqrt(rho') / (1 - alpha) r
  void WriteResiduals(double* corrected) const {
    Eigen::Map<Eigen::VectorXd>(corrected, r_.size()) =
        correction_.residual_scale * r_;
  }

  // sqrt(rho') (J - alpha / s r r^T J), into the residual block's rows of
  // compressed values.
  void WriteJacobian(const ResidualBlock& block, double* values) const {
    for (int b = 0; b < block.num_arguments; ++b) {
      const Argument& argument = ArgumentOf(block, b);
      if (argument.block < 0) continue;
      const Eigen::Map<const RowMajorMatrix> J = Tangent(block, b);
      Eigen::Map<RowMajorMatrix, 0, Eigen::OuterStride<>> corrected(
          values + argument.entry,
          J.rows(),
          J.cols(),
          Eigen::OuterStride<>(block.row_length));
      if (correction_.jacobian_scale == 1.0) {
        corrected = J;
      } else {
        corrected = correction_.jacobian_scale * J;
      }
      if (correction_.alpha_by_s != 0.0) {
        const Eigen::RowVectorXd r_J = r_.transpose() * corrected;
        corrected -= correction_.alpha_by_s * r_ * r_J;
      }
    }
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
            linearizer_.values_.data() + block.first_argument,
            w.data(),
            second.data())) {
      *error = BlockMessage(block.index, "WeightedHessian returned false");
      return false;
    }
    int row = 0;
    for (int a = 0; a < block.num_arguments; row += sizes[a++]) {
      const int block_a = ArgumentOf(block, a).block;
      if (block_a < 0) continue;
      int col = 0;
      for (int b = 0; b < block.num_arguments; col += sizes[b++]) {
        const int block_b = ArgumentOf(block, b).block;
        if (block_b < 0) continue;
        const Eigen::Map<const RowMajorMatrix> J_a = Tangent(block, a);
        const Eigen::Map<const RowMajorMatrix> J_b = Tangent(block, b);
        hessian->block(linearizer_.blocks_[block_a].column,
                       linearizer_.blocks_[block_b].column,
                       J_a.cols(),
                       J_b.cols()) +=
            PullBack(
                block_a, block_b, second.block(row, col, sizes[a], sizes[b])) +
            correction_.rho[1] * J_a.transpose() * J_b +
            2.0 * correction_.rho[2] * (J_a.transpose() * r_) *
                (J_b.transpose() * r_).transpose();
      }
    }
    return true;
  }

 private:
  const Argument& ArgumentOf(const ResidualBlock& block, int b) const {
    return linearizer_.arguments_[block.first_argument + b];
  }

  // dr/d(tangent of argument b), uncorrected.
  Eigen::Map<const RowMajorMatrix> Tangent(const ResidualBlock& block,
                                           int b) const {
    return {tangent_[b],
            block.size,
            linearizer_.blocks_[ArgumentOf(block, b).block].tangent_size};
  }

  // Memory for the Jacobians by the arguments that are not constant; false if
  // there are none.
  bool Reserve(const ResidualBlock& block) {
    std::size_t size = 0;
    for (int b = 0; b < block.num_arguments; ++b) {
      const int index = ArgumentOf(block, b).block;
      if (index < 0) continue;
      const ParameterBlock& parameters = linearizer_.blocks_[index];
      size += std::size_t{1} * block.size *
              (parameters.ambient_size + parameters.tangent_size);
    }
    if (memory_.size() < size) memory_.resize(size);
    ambient_.assign(block.num_arguments, nullptr);
    tangent_.assign(block.num_arguments, nullptr);
    double* memory = memory_.data();
    for (int b = 0; b < block.num_arguments; ++b) {
      const int index = ArgumentOf(block, b).block;
      if (index < 0) continue;
      const ParameterBlock& parameters = linearizer_.blocks_[index];
      ambient_[b] = memory;
      tangent_[b] = memory;
      memory += std::ptrdiff_t{block.size} * parameters.ambient_size;
      if ((*plus_jacobians_)[index].size() == 0) continue;
      tangent_[b] = memory;
      memory += std::ptrdiff_t{block.size} * parameters.tangent_size;
    }
    return size > 0;
  }

  void ToTangent(const ResidualBlock& block) {
    for (int b = 0; b < block.num_arguments; ++b) {
      if (tangent_[b] == ambient_[b]) continue;
      const RowMajorMatrix& P = (*plus_jacobians_)[ArgumentOf(block, b).block];
      Eigen::Map<RowMajorMatrix>(tangent_[b], block.size, P.cols()).noalias() =
          Eigen::Map<const RowMajorMatrix>(ambient_[b], block.size, P.rows())
              .lazyProduct(P);
    }
  }

  // P_a^T H P_b.
  Eigen::MatrixXd PullBack(int a, int b, const Eigen::MatrixXd& H) const {
    const RowMajorMatrix& P_a = (*plus_jacobians_)[a];
    const RowMajorMatrix& P_b = (*plus_jacobians_)[b];
    Eigen::MatrixXd result = P_a.size() > 0 ? P_a.transpose() * H : H;
    if (P_b.size() > 0) result = result * P_b;
    return result;
  }

  const ProblemLinearizer& linearizer_;
  // One a parameter block; empty where it has no manifold.
  const std::vector<RowMajorMatrix>* plus_jacobians_;
  Eigen::VectorXd r_;
  std::vector<double> memory_;
  // dr/d(argument), one an argument, null if it is constant; and the same times
  // P, which is the same memory where there is no manifold.
  std::vector<double*> ambient_;
  std::vector<double*> tangent_;
  Correction correction_;
};

// Reads the problem's structure in one pass over its residual blocks: each
// question to a ceres::Problem is a look-up.
class ProblemLinearizer::Reader {
 public:
  Reader(const ceres::Problem& problem, ProblemLinearizer* linearizer)
      : problem_(problem), linearizer_(*linearizer) {
    block_of_.reserve(problem.NumParameterBlocks());
  }

  void ReadAll() {
    std::vector<ceres::ResidualBlockId> ids;
    problem_.GetResidualBlocks(&ids);
    linearizer_.residual_blocks_.reserve(ids.size());
    linearizer_.arguments_.reserve(2 * ids.size());
    linearizer_.values_.reserve(2 * ids.size());
    for (std::size_t i = 0; i < ids.size(); ++i) {
      AddResidualBlock(ids[i], static_cast<int>(i));
    }
    AddUnusedParameterBlocks();
  }

  void ReadBatch(const std::vector<ceres::ResidualBlockId>& batch) {
    std::vector<ceres::ResidualBlockId> ids;
    problem_.GetResidualBlocks(&ids);
    std::unordered_map<ceres::ResidualBlockId, int> index_of;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      problem_.GetParameterBlocksForResidualBlock(ids[i], &values_);
      for (double* values : values_) AddParameterBlock(values);
      index_of[ids[i]] = static_cast<int>(i);
    }
    AddUnusedParameterBlocks();
    for (const ceres::ResidualBlockId id : batch) {
      const auto it = index_of.find(id);
      CHECK(it != index_of.end())
          << "A residual block of the mini-batch is not part of the problem.";
      AddResidualBlock(id, it->second);
    }
  }

 private:
  void AddUnusedParameterBlocks() {
    problem_.GetParameterBlocks(&values_);
    for (double* values : values_) AddParameterBlock(values);
  }

  // Returns its index in blocks_, -1 if it is constant.
  int AddParameterBlock(double* values) {
    const auto [it, is_new] = block_of_.try_emplace(values, -1);
    if (!is_new || problem_.IsParameterBlockConstant(values)) {
      return it->second;
    }
    it->second = static_cast<int>(linearizer_.blocks_.size());
    const ParameterBlock block = {values,
                                  problem_.ParameterBlockSize(values),
                                  problem_.ParameterBlockTangentSize(values),
                                  linearizer_.num_parameters_,
                                  linearizer_.num_ambient_,
                                  problem_.GetManifold(values)};
    linearizer_.parameter_blocks_.push_back(values);
    linearizer_.blocks_.push_back(block);
    linearizer_.tangent_sizes_.push_back(block.tangent_size);
    linearizer_.num_parameters_ += block.tangent_size;
    linearizer_.num_ambient_ += block.ambient_size;
    return it->second;
  }

  void AddResidualBlock(ceres::ResidualBlockId id, int index) {
    std::vector<Argument>& arguments = linearizer_.arguments_;
    ResidualBlock block;
    block.cost_function = problem_.GetCostFunctionForResidualBlock(id);
    block.loss_function = problem_.GetLossFunctionForResidualBlock(id);
    block.index = index;
    block.row = linearizer_.num_residuals_;
    block.size = block.cost_function->num_residuals();
    block.first_argument = static_cast<int>(arguments.size());
    problem_.GetParameterBlocksForResidualBlock(id, &values_);
    block.num_arguments = static_cast<int>(values_.size());
    block.row_length = 0;
    by_column_.clear();
    for (double* values : values_) {
      const int b = AddParameterBlock(values);
      if (b >= 0) by_column_.emplace_back(b, arguments.size());
      linearizer_.values_.push_back(values);
      arguments.push_back({b, 0});
    }
    std::sort(by_column_.begin(), by_column_.end());
    for (const auto& [b, argument] : by_column_) {
      arguments[argument].entry = block.row_length;
      block.row_length += linearizer_.blocks_[b].tangent_size;
    }
    linearizer_.num_residuals_ += block.size;
    linearizer_.residual_blocks_.push_back(block);
  }

  const ceres::Problem& problem_;
  ProblemLinearizer& linearizer_;
  std::unordered_map<const double*, int> block_of_;  // of blocks_; -1: constant
  std::vector<double*> values_;
  std::vector<std::pair<int, std::size_t>> by_column_;
};

ProblemLinearizer::ProblemLinearizer(const ceres::Problem* problem,
                                     Options options)
    : options_(std::move(options)) {
  CHECK(problem != nullptr);
  Reader reader(*problem, this);
  if (options_.residual_blocks.empty()) {
    reader.ReadAll();
  } else {
    reader.ReadBatch(options_.residual_blocks);
  }
}

std::shared_ptr<SparseJacobian> ProblemLinearizer::NewSparsity() const {
  std::int64_t num_entries = 0;
  for (const ResidualBlock& block : residual_blocks_) {
    num_entries += std::int64_t{block.size} * block.row_length;
  }
  CHECK_LE(num_entries, std::numeric_limits<int>::max())
      << "J has more entries than a sparse matrix can count.";
  SparseJacobian::Matrix J(num_residuals_, num_parameters_);
  J.resizeNonZeros(static_cast<int>(num_entries));
  int* row_start = J.outerIndexPtr();
  int* column = J.innerIndexPtr();
  *row_start = 0;
  for (const ResidualBlock& block : residual_blocks_) {
    const int* const first_row = column;
    for (int b = 0; b < block.num_arguments; ++b) {
      const Argument& argument = arguments_[block.first_argument + b];
      if (argument.block < 0) continue;
      const ParameterBlock& parameters = blocks_[argument.block];
      std::iota(column + argument.entry,
                column + argument.entry + parameters.tangent_size,
                parameters.column);
    }
    column += block.row_length;
    for (int i = 0; i < block.size; ++i) {
      if (i > 0) column = std::copy_n(first_row, block.row_length, column);
      row_start[1] = row_start[0] + block.row_length;
      ++row_start;
    }
  }
  return std::make_shared<SparseJacobian>(std::move(J), tangent_sizes_);
}

void ProblemLinearizer::Prepare(bool evaluate_jacobians) const {
  if (options_.evaluation_callback != nullptr) {
    options_.evaluation_callback->PrepareForEvaluation(
        evaluate_jacobians, /*new_evaluation_point=*/true);
  }
}

bool ProblemLinearizer::PlusJacobians(std::vector<RowMajorMatrix>* jacobians,
                                      std::string* error) const {
  jacobians->assign(blocks_.size(), RowMajorMatrix());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].manifold == nullptr) continue;
    RowMajorMatrix& P = (*jacobians)[b];
    P.resize(blocks_[b].ambient_size, blocks_[b].tangent_size);
    if (!blocks_[b].manifold->PlusJacobian(blocks_[b].values, P.data())) {
      *error = "the PlusJacobian of parameter block " + std::to_string(b) +
               " (of those that are not constant) failed";
      return false;
    }
  }
  return true;
}

std::shared_ptr<SparseJacobian> ProblemLinearizer::NewJacobian() const {
  if (last_jacobian_ == nullptr) {
    last_jacobian_ = NewSparsity();
  } else if (last_jacobian_.use_count() != 1) {
    last_jacobian_ = std::make_shared<SparseJacobian>(*last_jacobian_);
  }
  return last_jacobian_;
}

// Which of the Jacobians that were written into J is to blame.
std::string ProblemLinearizer::NotFinite(
    const SparseJacobian::Matrix& J) const {
  for (const ResidualBlock& block : residual_blocks_) {
    for (int b = 0; b < block.num_arguments; ++b) {
      const Argument& argument = arguments_[block.first_argument + b];
      if (argument.block < 0) continue;
      for (int row = block.row; row < block.row + block.size; ++row) {
        if (!J.coeffs()
                 .segment(J.outerIndexPtr()[row] + argument.entry,
                          tangent_sizes_[argument.block])
                 .allFinite()) {
          return BlockMessage(block.index,
                              "its Jacobian by parameter block " +
                                  std::to_string(b) + " is not finite");
        }
      }
    }
  }
  return "";
}

bool ProblemLinearizer::CanComputeHessian(std::string* error) const {
  std::vector<RowMajorMatrix> P;
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
    for (int b = 0; b < block.num_arguments; ++b) {
      const int index = arguments_[block.first_argument + b].block;
      if (index < 0) continue;
      is_constant = false;
      if (!is_linear[index]) {
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
  std::vector<RowMajorMatrix> plus_jacobians;
  if (!PlusJacobians(&plus_jacobians, error)) return false;
  const std::shared_ptr<SparseJacobian> jacobian = NewJacobian();
  const SparseJacobian::Matrix& J = jacobian->matrix();
  Eigen::VectorXd r(num_residuals_);
  double cost = 0.0;
  Prepare(/*evaluate_jacobians=*/true);
  BlockEvaluation evaluation(*this, &plus_jacobians);
  for (const ResidualBlock& block : residual_blocks_) {
    if (!evaluation.Evaluate(block, error)) return false;
    cost += evaluation.cost();
    evaluation.WriteResiduals(r.data() + block.row);
    evaluation.WriteJacobian(
        block, jacobian->mutable_values() + J.outerIndexPtr()[block.row]);
    if (parts.hessian && block.row_length > 0 &&
        !evaluation.AddHessian(block, &linearization->hessian, error)) {
      return false;
    }
  }
  if (!J.coeffs().allFinite()) {
    *error = NotFinite(J);
    return false;
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
    if (static_cast<double>(J.nonZeros()) >=
        kDense * static_cast<double>(J.rows()) *
            static_cast<double>(J.cols())) {
      linearization->jacobian =
          std::make_shared<DenseJacobian>(Eigen::MatrixXd(J), tangent_sizes_);
    } else {
      linearization->jacobian = jacobian;
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
