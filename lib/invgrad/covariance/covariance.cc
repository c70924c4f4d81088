#include "invgrad/covariance.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/covariance/pseudo_inverse.h"
#include "invgrad/internal/logging.h"
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

// The largest singular value of each group, and the SVDs of the dense ones.
struct GroupSpectra {
  std::vector<double> largest;
  std::vector<RightSvd> svds;
  double s_max = 0.0;
};

bool FindSpectra(const RankReport::Options& options,
                 const std::vector<BlockGroup>& groups,
                 GroupSpectra* spectra,
                 std::string* error) {
  spectra->svds.resize(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    RightSvd* svd = &spectra->svds[g];
    if (IsDense(options, groups[g])) *svd = ComputeRightSvd(groups[g].A);
    const double largest =
        svd->s.size() > 0 ? svd->s[0] : LargestSingularValue(groups[g].A);
    if (!std::isfinite(largest)) {
      *error = "J is not finite, or its SVD did not converge";
      return false;
    }
    spectra->largest.push_back(largest);
    spectra->s_max = std::max(spectra->s_max, largest);
  }
  return true;
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

// Fills a Covariance. The report's blocks and the Covariance's are the same.
class Covariance::Computation {
 public:
  Computation(const Options& options,
              const ceres::Problem& problem,
              Covariance* result)
      : options_(options), problem_(problem), result_(*result) {}

  bool Run(const std::vector<Pair>& pairs, std::string* error) {
    if (!options_.rank.IsValid(error) ||
        !GroupBlocks(
            options_.rank, problem_, &report_, &at_bound_, &groups_, error)) {
      return false;
    }
    AddBlocks();
    AddRequests(pairs);
    GroupSpectra spectra;
    if (!FindSpectra(options_.rank, groups_, &spectra, error)) return false;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      PseudoInverse inverse;
      if (!Invert(g, spectra, &inverse, error)) {
        *error = fmt::format("the group of {}: {}",
                             report_.blocks[groups_[g].blocks.front()].name,
                             *error);
        return false;
      }
      AddGroup(groups_[g], requests_[g], inverse);
    }
    if (!ScaleByResidualVariance(error)) return false;
    SetStandardDeviations();
    return true;
  }

 private:
  // The pairs of blocks of a group.
  struct GroupRequests {
    std::vector<std::pair<int, int>> pairs;  // of the report's blocks
    std::vector<GroupPair> in_group;
  };

  void AddBlocks() {
    result_.cost_ = report_.cost;
    result_.num_residuals_ = report_.num_residuals;
    result_.num_parameters_ = report_.num_parameters;
    result_.uses_residual_variance_ = options_.use_residual_variance;
    for (const RankReport::Block& from : report_.blocks) {
      result_.index_[from.values] = static_cast<int>(result_.blocks_.size());
      Block block;
      block.block = from;
      block.values = Eigen::Map<const VectorXd>(from.values, from.size);
      // Without residuals, until a group says otherwise.
      block.undetermined_shares = VectorXd::Ones(from.tangent_size);
      block.weak_variances = VectorXd::Zero(from.tangent_size);
      block.omitted_variances = VectorXd::Zero(from.tangent_size);
      block.plus_jacobian = PlusJacobian(problem_, from);
      block.at_bound = at_bound_[result_.blocks_.size()];
      block.undetermined_shares(block.at_bound).setZero();
      result_.num_parameters_ -= static_cast<int>(block.at_bound.size());
      result_.blocks_.push_back(std::move(block));
    }
    for (const RankReport::Unused& unused : report_.unused) {
      if (!unused.has_rounding) continue;
      Block& block = result_.blocks_[unused.block];
      std::set_difference(unused.tangent.begin(),
                          unused.tangent.end(),
                          block.at_bound.begin(),
                          block.at_bound.end(),
                          std::back_inserter(block.rounding));
    }
  }

  // The index of a block; -1: constant.
  int IndexOf(const double* values) {
    CHECK(problem_.HasParameterBlock(values))
        << "A block of the covariance is not part of the problem.";
    const auto it = result_.index_.find(values);
    if (it != result_.index_.end()) return it->second;
    result_.constant_sizes_[values] = {
        problem_.ParameterBlockTangentSize(values),
        problem_.ParameterBlockSize(values)};
    return -1;
  }

  // Blocks of different groups have no covariance.
  void AddRequests(const std::vector<Pair>& pairs) {
    std::vector<int> place(report_.blocks.size(), -1);  // in the block's group
    for (const BlockGroup& group : groups_) {
      for (std::size_t k = 0; k < group.blocks.size(); ++k) {
        place[group.blocks[k]] = static_cast<int>(k);
      }
    }
    requests_.resize(groups_.size());
    for (const auto& [a, b] : pairs) {
      const auto [i, j] = std::minmax({IndexOf(a), IndexOf(b)});
      if (i < 0) continue;
      const RankReport::Block& first = report_.blocks[i];
      const RankReport::Block& second = report_.blocks[j];
      const bool is_new = result_.computed_
                              .try_emplace({i, j},
                                           MatrixXd::Zero(first.tangent_size,
                                                          second.tangent_size))
                              .second;
      if (!is_new || first.group < 0 || first.group != second.group) continue;
      requests_[first.group].pairs.emplace_back(i, j);
      requests_[first.group].in_group.emplace_back(place[i], place[j]);
    }
  }

  bool Invert(std::size_t g,
              const GroupSpectra& spectra,
              PseudoInverse* inverse,
              std::string* error) const {
    const BlockGroup& group = groups_[g];
    const std::vector<GroupPair>& pairs = requests_[g].in_group;
    const double limit = options_.rank.threshold * spectra.s_max;
    if (IsDense(options_.rank, group)) {
      const double weak = options_.rank.weak_threshold * spectra.s_max;
      *inverse =
          DensePseudoInverse(group, spectra.svds[g], {limit, weak}, pairs);
      return true;
    }
    const GaugeMatcher matcher(options_.rank, problem_, report_, group);
    return SparsePseudoInverse(group,
                               spectra.largest[g],
                               limit,
                               options_.rank.max_directions,
                               matcher.LargestUnseenSpan(limit),
                               pairs,
                               inverse,
                               error);
  }

  void AddGroup(const BlockGroup& group,
                const GroupRequests& requests,
                const PseudoInverse& inverse) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const bool is_known = inverse.weak_variances.size() > 0;
    result_.rank_ += static_cast<int>(group.A.cols() - inverse.V_0.cols());
    for (std::size_t k = 0; k < group.blocks.size(); ++k) {
      Block& block = result_.blocks_[group.blocks[k]];
      for (int i = group.offsets[k]; i < group.offsets[k + 1]; ++i) {
        const int tangent = group.columns[i] - block.block.column;
        block.undetermined_shares[tangent] =
            std::min(1.0, inverse.V_0.row(i).squaredNorm());
        block.weak_variances[tangent] =
            is_known ? inverse.weak_variances[i] : kNaN;
        block.omitted_variances[tangent] =
            is_known ? inverse.omitted_variances[i] : kNaN;
      }
    }
    for (std::size_t p = 0; p < requests.pairs.size(); ++p) {
      const auto& [a, b] = requests.pairs[p];
      Expand(inverse.blocks[p],
             group,
             requests.in_group[p],
             report_.blocks[a].column,
             report_.blocks[b].column,
             &result_.computed_[{a, b}]);
    }
  }

  bool ScaleByResidualVariance(std::string* error) {
    if (!options_.use_residual_variance) return true;
    const double variance = result_.residual_variance();
    if (!std::isfinite(variance)) {
      *error = fmt::format(
          "use_residual_variance needs more residuals ({}) than determined "
          "parameters ({})",
          result_.num_residuals_,
          result_.rank_);
      return false;
    }
    for (auto& [pair, C] : result_.computed_) C *= variance;
    for (Block& block : result_.blocks_) {
      block.weak_variances *= variance;
      block.omitted_variances *= variance;
    }
    return true;
  }

  void SetStandardDeviations() {
    for (const auto& [pair, C] : result_.computed_) {
      if (pair.first != pair.second) continue;
      Block& block = result_.blocks_[pair.first];
      block.standard_deviations =
          (block.undetermined_shares.array() >= kUndetermined)
              .select(std::numeric_limits<double>::infinity(),
                      C.diagonal().array().max(0.0).sqrt());
    }
  }

  const Options& options_;
  const ceres::Problem& problem_;
  Covariance& result_;
  RankReport report_;
  std::vector<std::vector<int>> at_bound_;  // of each block of the report
  std::vector<BlockGroup> groups_;
  std::vector<GroupRequests> requests_;  // of each group
};

bool ComputeCovariance(const Covariance::Options& options,
                       const ceres::Problem& problem,
                       const std::vector<Covariance::Pair>& pairs,
                       Covariance* covariance,
                       std::string* error) {
  CHECK(covariance != nullptr);
  CHECK(error != nullptr);
  Covariance result;
  if (!Covariance::Computation(options, problem, &result).Run(pairs, error)) {
    return false;
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
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  MatrixXd result = TangentBlock(a, b);
  if (constant_sizes_.count(a) + constant_sizes_.count(b) > 0) {
    return result.setConstant(kNaN);
  }
  const VectorXd& s_a = block(a).standard_deviations;
  const VectorXd& s_b = block(b).standard_deviations;
  CHECK(s_a.size() == result.rows() && s_b.size() == result.cols())
      << "Correlations need the pairs (a, a) and (b, b).";
  for (Index j = 0; j < result.cols(); ++j) {
    for (Index i = 0; i < result.rows(); ++i) {
      const double scale = s_a[i] * s_b[j];
      const bool is_known = scale > 0.0 && std::isfinite(scale);
      result(i, j) = is_known ? result(i, j) / scale : kNaN;
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
