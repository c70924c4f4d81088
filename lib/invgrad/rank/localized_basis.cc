#include "invgrad/rank/localized_basis.h"

#include <algorithm>
#include <numeric>

#include "Eigen/LU"
#include "invgrad/rank/decompositions.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Directions V c that are zero, to kNoPart, outside of the rows [begin, end).
// |V_b c|^2 = |c|^2 selects candidates; the rows outside confirm them.
MatrixXd WithinRows(const Eigen::Ref<const MatrixXd>& V, int begin, int end) {
  constexpr double kInside = 1.0 - 1e-6;
  const MatrixXd V_b = V.middleRows(begin, end - begin);
  MatrixXd found(V.rows(), 0);
  if (V_b.squaredNorm() < kInside) return found;  // true of most blocks
  // Of the smaller side: c = V_b^T u / s.
  const bool is_wide = V_b.rows() < V_b.cols();
  const RightSvd svd =
      ComputeRightSvd(is_wide ? MatrixXd(V_b.transpose()) : V_b);
  for (Index i = 0; i < svd.s.size() && svd.s[i] * svd.s[i] >= kInside; ++i) {
    const VectorXd c = is_wide
                           ? VectorXd(V_b.transpose() * svd.V.col(i) / svd.s[i])
                           : VectorXd(svd.V.col(i));
    VectorXd v = V * c;
    const double outside =
        v.head(begin).squaredNorm() + v.tail(V.rows() - end).squaredNorm();
    if (outside > kNoPart * kNoPart) continue;
    v.head(begin).setZero();
    v.tail(V.rows() - end).setZero();
    found.conservativeResize(Eigen::NoChange, found.cols() + 1);
    found.rightCols(1) = v.normalized();
  }
  return found;
}

// The reduced echelon form on pivot rows.
MatrixXd Echelon(const MatrixXd& V) {
  const MatrixXd WT = V.transpose();
  std::vector<int> order = PivotOrder(WT);
  order.resize(static_cast<std::size_t>(V.cols()));
  const MatrixXd pivots = WT(Eigen::all, order);
  MatrixXd W = pivots.partialPivLu().solve(WT).transpose();
  for (auto column : W.colwise()) {
    column.normalize();
    // Rounding, times the condition of the pivots.
    column = (column.array().abs() < 1e-9).select(0.0, column);
  }
  return W;
}

}  // namespace

int NumParts(const Eigen::Ref<const VectorXd>& v,
             const std::vector<int>& offsets) {
  int count = 0;
  for (std::size_t b = 0; b + 1 < offsets.size(); ++b) {
    const int size = offsets[b + 1] - offsets[b];
    if (v.segment(offsets[b], size).norm() > kNoPart) ++count;
  }
  return count;
}

MatrixXd OrthogonalRest(const Eigen::Ref<const MatrixXd>& V,
                        const Eigen::Ref<const MatrixXd>& U) {
  if (U.cols() == 0) return V;
  const Index rest = V.cols() - U.cols();
  if (rest <= 0) return MatrixXd(V.rows(), 0);
  return V * ComputeRightSvd(U.transpose() * V).V.rightCols(rest);
}

LocalizedBasis Localize(const Eigen::Ref<const MatrixXd>& V,
                        const std::vector<int>& offsets) {
  LocalizedBasis basis;
  basis.single.resize(V.rows(), 0);
  for (std::size_t b = 0; b + 1 < offsets.size(); ++b) {
    const MatrixXd within = WithinRows(V, offsets[b], offsets[b + 1]);
    if (within.cols() == 0) continue;
    basis.single.conservativeResize(Eigen::NoChange,
                                    basis.single.cols() + within.cols());
    basis.single.rightCols(within.cols()) =
        within.cols() > 1 ? Echelon(within) : within;
    basis.single_blocks.insert(basis.single_blocks.end(),
                               static_cast<std::size_t>(within.cols()),
                               static_cast<int>(b));
  }
  basis.rest = OrthogonalRest(V, basis.single);
  basis.localized_rest.resize(V.rows(), 0);
  if (basis.rest.cols() == 0) return basis;
  const MatrixXd W = Echelon(basis.rest);
  std::vector<int> num_parts;
  for (const auto column : W.colwise()) {
    num_parts.push_back(NumParts(column, offsets));
  }
  std::vector<int> order(num_parts.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&num_parts](int a, int b) {
    return num_parts[a] < num_parts[b];
  });
  basis.localized_rest = W(Eigen::all, order);
  return basis;
}

}  // namespace invgrad
