#include "invgrad/rank/localized_basis.h"

#include <algorithm>
#include <numeric>

#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "Eigen/QR"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Directions V c that are zero outside of the rows [begin, end), to kNoPart.
// |V_b c|^2 = |c|^2 tells candidates; their rest says whether they are.
MatrixXd WithinRows(const Eigen::Ref<const MatrixXd>& V, int begin, int end) {
  const MatrixXd V_b = V.middleRows(begin, end - begin);
  MatrixXd found(V.rows(), 0);
  // No row is long enough: most blocks end here.
  if (V_b.squaredNorm() < 1.0 - 1e-6) return found;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(V_b.transpose() * V_b);
  for (Index i = V.cols() - 1; i >= 0; --i) {
    if (eigen.eigenvalues()[i] < 1.0 - 1e-6) break;
    VectorXd v = V * eigen.eigenvectors().col(i);
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
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(V.transpose());
  const Index k = V.cols();
  MatrixXd pivots(k, k);
  for (Index i = 0; i < k; ++i) {
    pivots.row(i) = V.row(qr.colsPermutation().indices()[i]);
  }
  MatrixXd W = pivots.transpose().partialPivLu().solve(V.transpose());
  W.transposeInPlace();
  for (Index j = 0; j < k; ++j) {
    W.col(j).normalize();
    // Rounding, times the condition of the pivots.
    W.col(j) = (W.col(j).array().abs() < 1e-9).select(0.0, W.col(j));
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
  // The last columns of the Q of V^T U are orthogonal to it.
  const Eigen::HouseholderQR<MatrixXd> qr(V.transpose() * U);
  const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(V.cols(), V.cols());
  return V * Q.rightCols(rest);
}

LocalizedBasis Localize(const Eigen::Ref<const MatrixXd>& V,
                        const std::vector<int>& offsets) {
  LocalizedBasis basis;
  basis.single.resize(V.rows(), 0);
  for (std::size_t b = 0; b + 1 < offsets.size(); ++b) {
    const MatrixXd within = WithinRows(V, offsets[b], offsets[b + 1]);
    if (within.cols() == 0) continue;
    const Index before = basis.single.cols();
    basis.single.conservativeResize(Eigen::NoChange, before + within.cols());
    basis.single.rightCols(within.cols()) =
        within.cols() > 1 ? Echelon(within) : within;
    basis.single_blocks.insert(basis.single_blocks.end(),
                               static_cast<std::size_t>(within.cols()),
                               static_cast<int>(b));
  }
  basis.rest = OrthogonalRest(V, basis.single);
  basis.localized_rest = MatrixXd(V.rows(), 0);
  if (basis.rest.cols() == 0) return basis;
  const MatrixXd W = Echelon(basis.rest);
  std::vector<int> num_parts(static_cast<std::size_t>(W.cols()));
  std::vector<int> order(num_parts.size());
  std::iota(order.begin(), order.end(), 0);
  for (const int j : order) num_parts[j] = NumParts(W.col(j), offsets);
  std::stable_sort(order.begin(), order.end(), [&num_parts](int a, int b) {
    return num_parts[a] < num_parts[b];
  });
  basis.localized_rest.resize(V.rows(), W.cols());
  for (std::size_t j = 0; j < order.size(); ++j) {
    basis.localized_rest.col(static_cast<Index>(j)) = W.col(order[j]);
  }
  return basis;
}

}  // namespace invgrad
