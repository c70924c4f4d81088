#include "invgrad/covariance/pseudo_inverse.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "Eigen/LU"
#include "Eigen/QR"
#include "fmt/core.h"
#include "invgrad/covariance/gram_inverse.h"
#include "invgrad/covariance/schur_complement.h"
#include "invgrad/covariance/sparse_cholesky.h"
#include "invgrad/internal/qr.h"
#include "invgrad/internal/small_covariance.h"
#include "invgrad/rank/smallest_singular.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

// Sets rows of V_0 to zero that rounding errors have left.
void RemoveRounding(MatrixXd* V_0) {
  for (auto row : V_0->rowwise()) {
    if (row.squaredNorm() <= kLeastUndeterminedShare) row.setZero();
  }
}

// Of J, from an orthonormal basis V_0 of that of A. Each row of the result is
// as accurate as that of V_0, whatever the units of the parameters.
MatrixXd NullSpaceOfJ(const MatrixXd& V_0, const VectorXd& lengths) {
  const Index k = V_0.cols();
  if (k == 0) return V_0;
  MatrixXd N = lengths.cwiseInverse().asDiagonal() * V_0;
  // The identity in k rows, and entries of comparable size in the others.
  std::vector<int> pivots = PivotOrder(N.transpose());
  pivots.resize(static_cast<std::size_t>(k));
  const MatrixXd pivot_rows = N(pivots, Eigen::all);
  N = pivot_rows.transpose().partialPivLu().solve(N.transpose()).transpose();
  const MatrixXd R = N.householderQr().matrixQR().topRows(k);
  return R.triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(N);
}

// A symmetric G with A^T A G A^T A = A^T A: zero in the anchors' rows and
// columns, which are zero-based columns of A, one a column of V_0.
class AnchoredInverse {
 public:
  AnchoredInverse(const BlockGroup& group, const MatrixXd& V_0)
      : group_(group), place_(static_cast<std::size_t>(group.A.cols()), 0) {
    if (V_0.cols() > 0) {
      const std::vector<int> order = PivotOrder(V_0.transpose());
      for (Index i = 0; i < V_0.cols(); ++i) place_[order[i]] = -1;
    }
    for (std::size_t j = 0; j < place_.size(); ++j) {
      if (place_[j] < 0) continue;
      place_[j] = static_cast<int>(columns_.size());
      columns_.push_back(static_cast<int>(j));
    }
  }

  bool Factorize(std::string* error) {
    const SparseMatrix& A = group_.A;
    std::vector<int> sizes;
    sizes.reserve(columns_.size());
    for (const int j : columns_) {
      sizes.push_back(A.outerIndexPtr()[j + 1] - A.outerIndexPtr()[j]);
    }
    SparseMatrix rest(A.rows(), static_cast<Index>(columns_.size()));
    rest.reserve(sizes);
    for (Index j = 0; j < rest.cols(); ++j) {
      for (SparseMatrix::InnerIterator it(A, columns_[j]); it; ++it) {
        rest.insert(it.row(), j) = it.value();
      }
    }
    rest.makeCompressed();
    auto complement = std::make_unique<SchurComplement>(rest, Offsets());
    if (complement->IsSmall()) {
      if (!complement->Factorize(rest, error)) return false;
      Z_ = std::move(complement);
      return true;
    }
    auto cholesky = std::make_unique<SparseCholesky>();
    if (!cholesky->Factorize(rest, error)) return false;
    Z_ = std::move(cholesky);
    return true;
  }

  MatrixXd Times(const MatrixXd& B) const {
    MatrixXd result = MatrixXd::Zero(B.rows(), B.cols());
    result(columns_, Eigen::all) = Z_->Solve(MatrixXd(B(columns_, Eigen::all)));
    return result;
  }

  // For each pair of columns of A the entry; none if it costs a solution.
  std::vector<std::optional<double>> Entries(
      const std::vector<std::pair<int, int>>& entries) {
    std::vector<std::pair<int, int>> of_rest;
    std::vector<std::size_t> indices;
    std::vector<std::optional<double>> result(entries.size(), 0.0);
    for (std::size_t e = 0; e < entries.size(); ++e) {
      const auto [i, j] = entries[e];
      if (place_[i] < 0 || place_[j] < 0) continue;
      of_rest.emplace_back(place_[i], place_[j]);
      indices.push_back(e);
    }
    const std::vector<std::optional<double>> values = Z_->Entries(of_rest);
    for (std::size_t e = 0; e < indices.size(); ++e) {
      result[indices[e]] = values[e];
    }
    return result;
  }

 private:
  // Of the blocks, counted in columns_.
  std::vector<int> Offsets() const {
    std::vector<int> offsets = {0};
    for (std::size_t b = 1; b < group_.offsets.size(); ++b) {
      int end = offsets.back();
      for (int j = group_.offsets[b - 1]; j < group_.offsets[b]; ++j) {
        if (place_[j] >= 0) ++end;
      }
      offsets.push_back(end);
    }
    return offsets;
  }

  const BlockGroup& group_;
  std::vector<int> columns_;  // of A, without the anchors
  std::vector<int> place_;    // of each column of A in columns_; -1: an anchor
  std::unique_ptr<GramInverse> Z_;  // of A without the anchors' columns
};

// The pairs in whose blocks G is computed column by column: by the block whose
// columns are solved for.
using Solutions = std::map<int, std::vector<std::size_t>>;

// For each of these pairs, the block that more of them share.
Solutions ShareColumns(const std::vector<GroupPair>& pairs,
                       const std::vector<std::size_t>& of_pairs) {
  std::map<int, int> counts;
  for (const std::size_t p : of_pairs) {
    ++counts[pairs[p].first];
    ++counts[pairs[p].second];
  }
  Solutions solutions;
  for (const std::size_t p : of_pairs) {
    const auto [a, b] = pairs[p];
    solutions[counts[a] > counts[b] ? a : b].push_back(p);
  }
  return solutions;
}

class SparseBlocks {
 public:
  SparseBlocks(const BlockGroup& group,
               const std::vector<GroupPair>& pairs,
               AnchoredInverse* G)
      : group_(group), pairs_(pairs), G_(*G), blocks_(pairs.size()) {}

  // Blocks of G, in the scaled columns.
  std::vector<MatrixXd> Compute() {
    std::vector<std::size_t> rows;  // pairs of whole rows of blocks
    std::vector<std::size_t> others;
    std::map<int, int> counts;
    for (const auto& [a, b] : pairs_) {
      ++counts[a];
      if (a != b) ++counts[b];
    }
    // A block with so many others of the group is a row of blocks.
    constexpr double kRow = 0.2;
    const int row =
        1 + static_cast<int>(kRow * static_cast<double>(group_.blocks.size()));
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const auto [a, b] = pairs_[p];
      (std::max(counts[a], counts[b]) > row ? rows : others).push_back(p);
    }
    Solve(rows);
    Solve(TakeEntries(others));
    return std::move(blocks_);
  }

 private:
  int Begin(int b) const { return group_.offsets[b]; }
  int Size(int b) const { return group_.offsets[b + 1] - Begin(b); }

  void Solve(const std::vector<std::size_t>& of_pairs) {
    for (const auto& [column, users] : ShareColumns(pairs_, of_pairs)) {
      MatrixXd units = MatrixXd::Zero(group_.A.cols(), Size(column));
      units.middleRows(Begin(column), Size(column)).setIdentity();
      const MatrixXd G = G_.Times(units);
      for (const std::size_t p : users) {
        const auto [a, b] = pairs_[p];
        if (column == b) {
          blocks_[p] = G.middleRows(Begin(a), Size(a));
        } else {
          blocks_[p] = G.middleRows(Begin(b), Size(b)).transpose();
        }
      }
    }
  }

  // Returns the pairs with entries that cost a solution.
  std::vector<std::size_t> TakeEntries(
      const std::vector<std::size_t>& of_pairs) {
    std::vector<std::pair<int, int>> entries;
    for (const std::size_t p : of_pairs) {
      const auto [a, b] = pairs_[p];
      for (int j = 0; j < Size(b); ++j) {
        for (int i = 0; i < Size(a); ++i) {
          entries.emplace_back(Begin(a) + i, Begin(b) + j);
        }
      }
    }
    const std::vector<std::optional<double>> values = G_.Entries(entries);
    std::vector<std::size_t> missing;
    auto value = values.begin();
    for (const std::size_t p : of_pairs) {
      MatrixXd& block = blocks_[p];
      block.resize(Size(pairs_[p].first), Size(pairs_[p].second));
      bool is_complete = true;
      for (double& entry : block.reshaped()) {
        is_complete &= value->has_value();
        entry = (value++)->value_or(0.0);
      }
      if (!is_complete) missing.push_back(p);
    }
    return missing;
  }

  const BlockGroup& group_;
  const std::vector<GroupPair>& pairs_;
  AnchoredInverse& G_;
  std::vector<MatrixXd> blocks_;
};

// Whether all singular values of A but those of V_0 are above the limit: the
// largest eigenvalue of the pseudo-inverse of A^T A, if V_0 spans the null
// space, is at most limit^-2.
bool SpansNullSpace(const AnchoredInverse& G,
                    const MatrixXd& V_0,
                    double limit) {
  const double threshold = 1.0 / (limit * limit);
  return LargestEigenvalue(
             V_0.rows(),
             [&](const VectorXd& v) -> VectorXd {
               const VectorXd w = G.Times(v - V_0 * (V_0.transpose() * v));
               return w - V_0 * (V_0.transpose() * w);
             },
             threshold) <= threshold;
}

// The columns of V beside those of C = F F^T are as many as those of V_0.
VectorXd OmittedVariances(const BlockGroup& group,
                          const RightSvd& svd,
                          const MatrixXd& V_0) {
  constexpr double kResolved = 1e-12;  // smaller s / s_max are rounding errors
  VectorXd variances = VectorXd::Zero(V_0.rows());
  for (Index j = svd.s.size() - V_0.cols(); j < svd.s.size(); ++j) {
    if (svd.s[j] <= kResolved * svd.s[0]) continue;
    variances +=
        svd.V.col(j).cwiseQuotient(svd.s[j] * group.lengths).cwiseAbs2();
  }
  return (V_0.rowwise().squaredNorm().array() == 0.0).select(variances, 0.0);
}

}  // namespace

PseudoInverse DensePseudoInverse(const BlockGroup& group,
                                 const RightSvd& svd,
                                 const SingularLimits& limits,
                                 const std::vector<GroupPair>& pairs) {
  const Index rank = (svd.s.array() > limits.zero).count();
  const MatrixXd F_scaled =
      svd.V.leftCols(rank) * svd.s.head(rank).cwiseInverse().asDiagonal();
  PseudoInverse result;
  result.V_0 = svd.V.rightCols(svd.V.cols() - rank);
  if (result.V_0.cols() > 0) {
    const MatrixXd AtAV_0 = group.A.transpose() * (group.A * result.V_0).eval();
    result.V_0 = Orthonormalized(result.V_0 -
                                 F_scaled * (F_scaled.transpose() * AtAV_0));
    RemoveRounding(&result.V_0);
  }
  const MatrixXd N = NullSpaceOfJ(result.V_0, group.lengths);
  // C = F F^T
  MatrixXd F = group.lengths.cwiseInverse().asDiagonal() * F_scaled;
  F -= N * (N.transpose() * F);
  const Index num_weak = rank - (svd.s.array() > limits.weak).count();
  result.weak_variances = F.rightCols(num_weak).rowwise().squaredNorm();
  result.omitted_variances = OmittedVariances(group, svd, result.V_0);
  const auto rows = [&](int b) {
    return F.middleRows(group.offsets[b],
                        group.offsets[b + 1] - group.offsets[b]);
  };
  for (const auto& [a, b] : pairs) {
    result.blocks.push_back(rows(a) * rows(b).transpose());
  }
  return result;
}

bool SparsePseudoInverse(const BlockGroup& group,
                         double s_max,
                         double limit,
                         int max_directions,
                         const MatrixXd& V,
                         const std::vector<GroupPair>& pairs,
                         PseudoInverse* result,
                         std::string* error) {
  const SparseMatrix& A = group.A;
  MatrixXd V_0 = V.cols() > 0 ? Orthonormalized(V) : MatrixXd(A.cols(), 0);
  std::optional<AnchoredInverse> G;
  G.emplace(group, V_0);
  std::string why;
  if (!G->Factorize(&why) || !SpansNullSpace(*G, V_0, limit)) {
    SmallestSingular small;
    if (!SparseSmallestSingular(
            A, s_max, limit, max_directions, &small, error)) {
      return false;
    }
    if (!small.complete) {
      const std::string full_svd =
          MayBeDense(group)
              ? fmt::format(
                    "rank.max_dense_size of at least {} for a full "
                    "SVD, or ",
                    A.cols())
              : "";
      *error = fmt::format(
          "more than {} undetermined directions: try {}a larger "
          "rank.max_directions; ComputeRankReport names them",
          small.V.cols(),
          full_svd);
      return false;
    }
    V_0 = small.V;
    G.emplace(group, V_0);
    if (!G->Factorize(error)) return false;
  }
  if (V_0.cols() > 0) {
    // The search resolves V_0 to about 1e-9; this, to rounding.
    V_0 = Orthonormalized(V_0 - G->Times(A.transpose() * (A * V_0).eval()));
    RemoveRounding(&V_0);
  }
  const VectorXd inverse_lengths = group.lengths.cwiseInverse();
  const MatrixXd N = NullSpaceOfJ(V_0, group.lengths);
  MatrixXd W;  // G N, in the parameters' units
  MatrixXd NtW;
  if (N.cols() > 0) {
    W = inverse_lengths.asDiagonal() *
        G->Times(inverse_lengths.asDiagonal() * N);
    NtW = N.transpose() * W;
  }
  result->V_0 = std::move(V_0);
  result->blocks = SparseBlocks(group, pairs, &*G).Compute();
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const auto [a, b] = pairs[p];
    MatrixXd& C = result->blocks[p];
    const auto in_a = Eigen::seqN(group.offsets[a], C.rows());
    const auto in_b = Eigen::seqN(group.offsets[b], C.cols());
    C = inverse_lengths(in_a).asDiagonal() * C *
        inverse_lengths(in_b).asDiagonal();
    if (N.cols() == 0) continue;
    const MatrixXd N_a = N(in_a, Eigen::all);
    const MatrixXd N_b = N(in_b, Eigen::all);
    C += (N_a * NtW - W(in_a, Eigen::all)) * N_b.transpose() -
         N_a * W(in_b, Eigen::all).transpose();
    // Terms of other units may cancel to less than zero.
    if (a == b) C.diagonal() = C.diagonal().cwiseMax(0.0);
  }
  return true;
}

}  // namespace invgrad
