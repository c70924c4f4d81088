#include "invgrad/covariance/covariance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/covariance/pseudo_inverse.h"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/gauge_match.h"
#include "invgrad/rank/smallest_singular.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Above this share, nothing but rounding determines a parameter.
constexpr double kUndetermined = 1.0 - 1e-9;

// A pair of blocks with entries of C, and its blocks' places in their group.
struct GroupRequests {
  std::vector<std::pair<int, int>> pairs;  // of the report's blocks
  std::vector<GroupPair> in_group;
};

bool IsDense(const RankReport::Options& options, const BlockGroup& group) {
  return group.A.cols() <= options.max_dense_size;
}

bool ComputeGroup(const RankReport::Options& options,
                  const ceres::Problem& problem,
                  const RankReport& report,
                  const BlockGroup& group,
                  const RightSvd& svd,
                  double s_max,
                  double limit,
                  const std::vector<GroupPair>& pairs,
                  PseudoInverse* result,
                  std::string* error) {
  if (IsDense(options, group)) {
    *result = DensePseudoInverse(group, svd, limit, pairs);
    return true;
  }
  const GaugeMatcher matcher(options, problem, report, group);
  // The dimension of the null space is not known yet.
  const GaugeMatch gauge = matcher.Best(limit, 0, group.A.cols());
  return SparsePseudoInverse(group,
                             s_max,
                             limit,
                             options.max_directions,
                             gauge.directions,
                             pairs,
                             result,
                             error);
}

MatrixXd PlusJacobian(const ceres::Problem& problem,
                      const RankReport::Block& block) {
  const ceres::Manifold* manifold = problem.GetManifold(block.values);
  if (manifold == nullptr) return {};
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> P(
      block.size, block.tangent_size);
  if (P.size() > 0) {
    CHECK(manifold->PlusJacobian(block.values, P.data()));  // as in Linearize
  }
  return P;
}

// Writes a block of the group's columns to the rows and columns of a block of
// all tangent directions.
void Expand(const MatrixXd& from,
            const BlockGroup& group,
            const GroupPair& pair,
            int first_row,
            int first_column,
            MatrixXd* to) {
  for (Index j = 0; j < from.cols(); ++j) {
    for (Index i = 0; i < from.rows(); ++i) {
      (*to)(group.columns[group.offsets[pair.first] + i] - first_row,
            group.columns[group.offsets[pair.second] + j] - first_column) =
          from(i, j);
    }
  }
}

}  // namespace

bool ComputeCovariance(const Covariance::Options& options,
                       const ceres::Problem& problem,
                       const std::vector<Covariance::Pair>& pairs,
                       Covariance* covariance,
                       std::string* error) {
  CHECK(covariance != nullptr);
  CHECK(error != nullptr);
  if (!options.rank.IsValid(error)) return false;
  RankReport report;
  std::vector<BlockGroup> groups;
  if (!GroupBlocks(options.rank, problem, &report, &groups, error)) {
    return false;
  }
  Covariance result;
  result.cost_ = report.cost;
  result.num_residuals_ = report.num_residuals;
  result.num_parameters_ = report.num_parameters;
  result.uses_residual_variance_ = options.use_residual_variance;
  for (const RankReport::Block& from : report.blocks) {
    result.index_[from.values] = static_cast<int>(result.blocks_.size());
    Covariance::Block block;
    block.block = from;
    block.values = Eigen::Map<const VectorXd>(from.values, from.size);
    // Without residuals, until a group says otherwise.
    block.undetermined_shares = VectorXd::Ones(from.tangent_size);
    block.plus_jacobian = PlusJacobian(problem, from);
    result.blocks_.push_back(std::move(block));
  }

  std::vector<int> place(report.blocks.size(), -1);  // of a block in its group
  for (const BlockGroup& group : groups) {
    for (std::size_t k = 0; k < group.blocks.size(); ++k) {
      place[group.blocks[k]] = static_cast<int>(k);
    }
  }
  std::vector<GroupRequests> requests(groups.size());
  for (const auto& [a, b] : pairs) {
    int blocks[2] = {-1, -1};
    const double* const values[2] = {a, b};
    for (int k = 0; k < 2; ++k) {
      CHECK(problem.HasParameterBlock(values[k]))
          << "A block of the covariance is not part of the problem.";
      const auto it = result.index_.find(values[k]);
      if (it != result.index_.end()) {
        blocks[k] = it->second;
      } else {
        result.constant_sizes_[values[k]] = {
            problem.ParameterBlockTangentSize(values[k]),
            problem.ParameterBlockSize(values[k])};
      }
    }
    if (blocks[0] < 0 || blocks[1] < 0) continue;
    if (blocks[0] > blocks[1]) std::swap(blocks[0], blocks[1]);
    const RankReport::Block& first = report.blocks[blocks[0]];
    const RankReport::Block& second = report.blocks[blocks[1]];
    const bool is_new = result.computed_
                            .try_emplace({blocks[0], blocks[1]},
                                         MatrixXd::Zero(first.tangent_size,
                                                        second.tangent_size))
                            .second;
    if (!is_new || first.group < 0 || first.group != second.group) continue;
    requests[first.group].pairs.emplace_back(blocks[0], blocks[1]);
    requests[first.group].in_group.emplace_back(place[blocks[0]],
                                                place[blocks[1]]);
  }

  double s_max = 0.0;
  std::vector<double> largest;
  std::vector<RightSvd> svds(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (IsDense(options.rank, groups[g])) {
      svds[g] = ComputeRightSvd(groups[g].A);
      largest.push_back(svds[g].s[0]);
    } else {
      largest.push_back(LargestSingularValue(groups[g].A));
    }
    if (!std::isfinite(largest.back())) {
      *error = "J is not finite, or its SVD did not converge";
      return false;
    }
    s_max = std::max(s_max, largest.back());
  }
  const double limit = options.rank.threshold * s_max;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const BlockGroup& group = groups[g];
    PseudoInverse inverse;
    if (!ComputeGroup(options.rank,
                      problem,
                      report,
                      group,
                      svds[g],
                      largest[g],
                      limit,
                      requests[g].in_group,
                      &inverse,
                      error)) {
      *error = fmt::format("the group of {}: {}",
                           report.blocks[group.blocks.front()].name,
                           *error);
      return false;
    }
    result.rank_ += static_cast<int>(group.A.cols() - inverse.N.cols());
    for (std::size_t k = 0; k < group.blocks.size(); ++k) {
      Covariance::Block& block = result.blocks_[group.blocks[k]];
      for (int i = group.offsets[k]; i < group.offsets[k + 1]; ++i) {
        block.undetermined_shares[group.columns[i] - block.block.column] =
            std::min(1.0, inverse.N.row(i).squaredNorm());
      }
    }
    for (std::size_t p = 0; p < requests[g].pairs.size(); ++p) {
      const auto& [a, b] = requests[g].pairs[p];
      Expand(inverse.blocks[p],
             group,
             requests[g].in_group[p],
             report.blocks[a].column,
             report.blocks[b].column,
             &result.computed_[{a, b}]);
    }
  }

  if (options.use_residual_variance) {
    if (!std::isfinite(result.residual_variance())) {
      *error = fmt::format(
          "use_residual_variance needs more residuals ({}) than determined "
          "parameters ({})",
          result.num_residuals_,
          result.rank_);
      return false;
    }
    for (auto& [pair, C] : result.computed_) C *= result.residual_variance();
  }
  for (const auto& [pair, C] : result.computed_) {
    if (pair.first != pair.second) continue;
    Covariance::Block& block = result.blocks_[pair.first];
    block.standard_deviations = C.diagonal().cwiseMax(0.0).cwiseSqrt();
    for (Index i = 0; i < C.rows(); ++i) {
      if (block.undetermined_shares[i] >= kUndetermined) {
        block.standard_deviations[i] = std::numeric_limits<double>::infinity();
      }
    }
  }
  *covariance = std::move(result);
  return true;
}

double Covariance::residual_variance() const {
  if (num_residuals_ <= rank_) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * cost_ / (num_residuals_ - rank_);
}

const Covariance::Block& Covariance::block(const double* values) const {
  const auto it = index_.find(values);
  CHECK(it != index_.end())
      << "The block is constant, or not part of the problem.";
  return blocks_[it->second];
}

MatrixXd Covariance::TangentBlock(const double* a, const double* b) const {
  const auto find = [this](const double* values, int* size) {
    const auto constant = constant_sizes_.find(values);
    if (constant == constant_sizes_.end()) {
      *size = block(values).block.tangent_size;
      return index_.at(values);
    }
    *size = constant->second[0];
    return -1;
  };
  int rows = 0;
  int cols = 0;
  const int i = find(a, &rows);
  const int j = find(b, &cols);
  if (i < 0 || j < 0) return MatrixXd::Zero(rows, cols);
  const auto computed = computed_.find({std::min(i, j), std::max(i, j)});
  CHECK(computed != computed_.end())
      << "The pair of blocks was not given to ComputeCovariance.";
  if (i <= j) return computed->second;
  return computed->second.transpose();
}

MatrixXd Covariance::AmbientBlock(const double* a, const double* b) const {
  MatrixXd C = TangentBlock(a, b);
  const auto lift = [this](const double* values, const MatrixXd& X) {
    const auto constant = constant_sizes_.find(values);
    if (constant != constant_sizes_.end()) {
      return MatrixXd(MatrixXd::Zero(constant->second[1], X.cols()));
    }
    const MatrixXd& P = block(values).plus_jacobian;
    return P.size() > 0 || block(values).block.tangent_size == 0
               ? MatrixXd(P * X)
               : X;
  };
  C = lift(a, C);
  C = lift(b, C.transpose());
  return C.transpose();
}

MatrixXd Covariance::Correlations(const double* a, const double* b) const {
  MatrixXd result = TangentBlock(a, b);
  const VectorXd& s_a = block(a).standard_deviations;
  const VectorXd& s_b = block(b).standard_deviations;
  CHECK(s_a.size() == result.rows() && s_b.size() == result.cols())
      << "Correlations need the pairs (a, a) and (b, b).";
  for (Index j = 0; j < result.cols(); ++j) {
    for (Index i = 0; i < result.rows(); ++i) {
      const double scale = s_a[i] * s_b[j];
      result(i, j) = scale > 0.0 && std::isfinite(scale)
                         ? result(i, j) / scale
                         : std::numeric_limits<double>::quiet_NaN();
    }
  }
  return result;
}

std::vector<Covariance::Pair> MarginalPairs(const ceres::Problem& problem) {
  std::vector<Covariance::Pair> pairs;
  for (const auto& block : ReadStructure(problem, {}).parameter_blocks) {
    pairs.emplace_back(block.values, block.values);
  }
  return pairs;
}

std::vector<Covariance::Pair> AllPairs(
    const std::vector<const double*>& blocks) {
  std::vector<Covariance::Pair> pairs;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    for (std::size_t j = i; j < blocks.size(); ++j) {
      pairs.emplace_back(blocks[i], blocks[j]);
    }
  }
  return pairs;
}

std::vector<Covariance::Pair> RowPairs(
    const ceres::Problem& problem, const std::vector<const double*>& blocks) {
  std::vector<Covariance::Pair> pairs;
  for (const auto& other : ReadStructure(problem, {}).parameter_blocks) {
    for (const double* block : blocks) pairs.emplace_back(block, other.values);
  }
  return pairs;
}

}  // namespace invgrad
