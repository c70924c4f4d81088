#include "invgrad/rank/anchor.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Eigen/Eigenvalues"
#include "Eigen/QR"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The singular values of a block's rows, descending. The squares are good to
// 1e-16 of the largest, so what is far below 1e-7 of it may be noise.
VectorXd SingularValues(const MatrixXd& A) {
  const MatrixXd gram = A.rows() < A.cols() ? MatrixXd(A * A.transpose())
                                            : MatrixXd(A.transpose() * A);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram,
                                                      Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
}

}  // namespace

std::vector<Anchor> ChooseAnchors(MatrixXd N,
                                  const std::vector<int>& offsets,
                                  const std::vector<bool>& can_hold_rows,
                                  int max_anchors) {
  constexpr double kRank = 1e-5;  // relative to the block's largest
  // A block that does not move is no anchor, and one that hardly does is a bad
  // one if there are others.
  constexpr double kFixed = 1e-6;
  constexpr double kFirm = 0.01;
  std::vector<Anchor> anchors;
  const int num_blocks = static_cast<int>(offsets.size()) - 1;
  while (N.cols() > 0 && static_cast<int>(anchors.size()) < max_anchors) {
    std::vector<double> norms(num_blocks);
    for (int b = 0; b < num_blocks; ++b) {
      norms[b] = N.middleRows(offsets[b], offsets[b + 1] - offsets[b]).norm();
    }
    const double largest = *std::max_element(norms.begin(), norms.end());
    int best = -1;
    int best_rank = 0;
    for (int b = 0; b < num_blocks; ++b) {
      const auto N_b = N.middleRows(offsets[b], offsets[b + 1] - offsets[b]);
      if (N_b.rows() < best_rank || !(norms[b] > kFixed * largest)) continue;
      const VectorXd s = SingularValues(N_b);
      const int rank = static_cast<int>((s.array() > kRank * s[0]).count());
      if (rank < best_rank) continue;
      if (rank > best_rank || kFirm * norms[b] > norms[best]) {
        best = b;
        best_rank = rank;
      }
    }
    if (best < 0) break;
    Anchor anchor;
    anchor.block = best;
    anchor.num_removed = best_rank;
    const MatrixXd N_b =
        N.middleRows(offsets[best], offsets[best + 1] - offsets[best]);
    anchor.rows.resize(static_cast<std::size_t>(N_b.rows()));
    std::iota(anchor.rows.begin(), anchor.rows.end(), 0);
    if (best_rank < N_b.rows() && can_hold_rows[best]) {
      // The rows that a QR decomposition with column pivoting takes first.
      const Eigen::ColPivHouseholderQR<MatrixXd> qr(N_b.transpose());
      for (int i = 0; i < best_rank; ++i) {
        anchor.rows[i] = static_cast<int>(qr.colsPermutation().indices()[i]);
      }
      anchor.rows.resize(best_rank);
      std::sort(anchor.rows.begin(), anchor.rows.end());
    }
    MatrixXd held(N.cols(), static_cast<Index>(anchor.rows.size()));
    for (std::size_t i = 0; i < anchor.rows.size(); ++i) {
      held.col(static_cast<Index>(i)) = N_b.row(anchor.rows[i]).transpose();
    }
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(held);
    const MatrixXd Q =
        qr.householderQ() * MatrixXd::Identity(N.cols(), N.cols());
    N = (N * Q.rightCols(N.cols() - best_rank)).eval();
    anchors.push_back(std::move(anchor));
  }
  return anchors;
}

}  // namespace invgrad
