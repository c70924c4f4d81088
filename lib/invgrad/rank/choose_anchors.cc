#include "invgrad/rank/choose_anchors.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "invgrad/core/dense_svd.h"
#include "invgrad/rank/decompositions.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// rank is 0 if no block remains.
struct AnchorBlock {
  int block = 0;
  int rank = 0;
};

AnchorBlock BestAnchorBlock(const MatrixXd& N,
                            const std::vector<int>& offsets) {
  constexpr double kRank = 1e-5;  // relative to the block's largest
  // A block that does not move cannot be an anchor, and a block that hardly
  // moves is a bad anchor if there are others.
  constexpr double kFixed = 1e-6;
  constexpr double kFirm = 0.01;
  std::vector<double> norms;
  for (std::size_t b = 0; b + 1 < offsets.size(); ++b) {
    norms.push_back(
        N.middleRows(offsets[b], offsets[b + 1] - offsets[b]).norm());
  }
  const double largest = *std::max_element(norms.begin(), norms.end());
  AnchorBlock best;
  for (std::size_t b = 0; b < norms.size(); ++b) {
    const int size = offsets[b + 1] - offsets[b];
    if (size < best.rank || !(norms[b] > kFixed * largest)) continue;
    const VectorXd s = SingularValues(N.middleRows(offsets[b], size));
    const int rank = static_cast<int>((s.array() > kRank * s[0]).count());
    if (rank > best.rank ||
        (rank == best.rank && kFirm * norms[b] > norms[best.block])) {
      best = {static_cast<int>(b), rank};
    }
  }
  return best;
}

}  // namespace

std::vector<Anchor> ChooseAnchors(MatrixXd N,
                                  const std::vector<int>& offsets,
                                  const std::vector<bool>& can_hold_rows,
                                  int max_anchors) {
  std::vector<Anchor> anchors;
  while (N.cols() > 0 && static_cast<int>(anchors.size()) < max_anchors) {
    const auto [block, rank] = BestAnchorBlock(N, offsets);
    if (rank == 0) break;
    Anchor anchor;
    anchor.block = block;
    anchor.num_removed = rank;
    const MatrixXd N_b =
        N.middleRows(offsets[block], offsets[block + 1] - offsets[block]);
    if (rank < N_b.rows() && can_hold_rows[block]) {
      anchor.rows = PivotOrder(N_b.transpose());
      anchor.rows.resize(rank);
      std::sort(anchor.rows.begin(), anchor.rows.end());
    } else {
      anchor.rows.resize(static_cast<std::size_t>(N_b.rows()));
      std::iota(anchor.rows.begin(), anchor.rows.end(), 0);
    }
    const MatrixXd held = N_b(anchor.rows, Eigen::all);
    N = (N * ComputeRightSvd(held).V.rightCols(N.cols() - rank)).eval();
    anchors.push_back(std::move(anchor));
  }
  return anchors;
}

}  // namespace invgrad
