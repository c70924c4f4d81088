#include <lapacke.h>

#include <algorithm>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/householder.h"
#include "invgrad/spectral/routes/two_stage.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The lower triangle is tiled by columns: full squares of kSquare on the
// diagonal, the rest of the tile of kTileWidth below them, and whole tiles. One
// tile and its share of V and W fit in a cache of 1 MB. The squares are small
// because half of their change is wasted.
constexpr Index kSquare = 64;
constexpr Index kTileWidth = 3 * kSquare;
static_assert(ColumnStrips::kWidth == kTileWidth,
              "A rank changes whole tiles.");
static_assert(ColumnStrips::kWidth % kBandwidth == 0, "A panel has one owner.");
constexpr Index kTileHeight = 512;

// Fills the upper triangles of the squares on the diagonal.
void MirrorSquares(const ColumnStrips& strips, MatrixXd* K) {
  strips.ForOwn([&](Index first, Index count) {
    for (Index j = first; j < first + count; ++j) {
      for (Index i = j / kSquare * kSquare; i < j; ++i) {
        (*K)(i, strips.Local(j)) = (*K)(j, strips.Local(i));
      }
    }
  });
}

// The end of the tile of this width, on a grid that starts at zero, that
// contains i.
Index TileEnd(Index i, Index width, Index m) {
  return std::min(m, (i / width + 1) * width);
}

// One sweep over this rank's part of the lower triangle of K from row `begin`
// on: A -= [V W] [W V]^T, unless VW is null, and X = A V, the rank's part of it,
// of the new VX = [V X].
void SweepTriangle(const ColumnStrips& strips,
                   const MatrixXd* VW,
                   const MatrixXd& WV,
                   Index begin,
                   MatrixXd* K,
                   MatrixXd* VX) {
  constexpr Index b = kBandwidth;
  const Index m = K->rows();
  const auto change_tile = [&](Index i, Index i_end, Index j, Index j_end) {
    const Index rows = i_end - i;
    const Index cols = j_end - j;
    auto A = K->block(i, strips.Local(j), rows, cols);
    const auto V_i = VX->block(i, 0, rows, b);
    const auto V_j = VX->block(j, 0, cols, b);
    auto X_i = VX->block(i, b, rows, b);
    auto X_j = VX->block(j, b, cols, b);
    if (VW != nullptr) {
      Gemm(Op::kNone,
           Op::kTranspose,
           -1.0,
           VW->middleRows(i, rows),
           WV.middleRows(j, cols),
           1.0,
           A);
    }
    Gemm(Op::kNone, Op::kNone, 1.0, A, V_j, 1.0, X_i);
    if (i != j) Gemm(Op::kTranspose, Op::kNone, 1.0, A, V_i, 1.0, X_j);
  };
  VX->block(begin, b, m - begin, b).setZero();
  Index end;
  for (Index j = begin; j < m; j = end) {
    end = TileEnd(j, kTileWidth, m);
    if (!strips.Owns(j)) continue;
    for (Index k = j; k < end;) {
      const Index square_end = TileEnd(k, kSquare, m);
      change_tile(k, square_end, k, square_end);
      if (square_end < end) change_tile(square_end, end, k, square_end);
      k = square_end;
    }
    for (Index i = end; i < m; i += kTileHeight) {
      change_tile(i, std::min(m, i + kTileHeight), j, end);
    }
  }
}

}  // namespace

void BandReduction::Compute(const ColumnStrips& strips,
                            MatrixXd* K,
                            VectorXd* tau) {
  CHECK_EQ(K->rows(), strips.size());
  CHECK_EQ(K->cols(), strips.num_local());
  const Index m = K->rows();
  constexpr Index b = kBandwidth;
  tau->resize(std::max<Index>(0, m - b));
  if (m <= b) return;
  VW_.resize(m, 2 * b);
  WV_.resize(m, 2 * b);
  next_VW_.resize(m, 2 * b);
  T_.resize(b, b);
  S_.resize(b, b);
  TS_.resize(b, b);
  MirrorSquares(strips, K);

  bool pending = false;
  for (Index k = 0; k < m; k += b) {
    const Index begin = k + b;  // of the rows that the panel clears
    const bool last = begin >= m;
    const Index cols = last ? m - k : b;
    if (pending && strips.Owns(k)) {
      Gemm(Op::kNone,
           Op::kTranspose,
           -1.0,
           VW_.bottomRows(m - k),
           WV_.middleRows(k, cols),
           1.0,
           K->block(k, strips.Local(k), m - k, cols));
    }
    if (last) break;

    FactorizePanel(strips, k, K, tau);
    SweepTriangle(strips, pending ? &VW_ : nullptr, WV_, begin, K, &next_VW_);
    ComputeW(strips.communicator(), begin);
    VW_.swap(next_VW_);
    pending = true;
  }
}

void BandReduction::FactorizePanel(const ColumnStrips& strips,
                                   Index k,
                                   MatrixXd* K,
                                   VectorXd* tau) {
  constexpr Index b = kBandwidth;
  const Index m = K->rows();
  const Index begin = k + b;
  const Index n = m - begin;
  const Index width = std::min(n, b);  // the number of reflectors
  auto V = next_VW_.block(begin, 0, n, width);
  next_VW_.bottomRows(n).setZero();
  if (strips.Owns(k)) {
    const Index k_local = strips.Local(k);
    auto panel = K->block(begin, k_local, n, width);
    LAPACKE_dgeqrt3_work(LAPACK_COL_MAJOR,
                         static_cast<int>(n),
                         static_cast<int>(width),
                         panel.data(),
                         static_cast<int>(m),
                         T_.data(),
                         static_cast<int>(b));
    T_.triangularView<Eigen::StrictlyLower>().setZero();
    tau->segment(k, width) = T_.diagonal().head(width);

    // If the panel is wider than high: the columns right of the square.
    for (Index j = k_local + width; j < k_local + b; ++j) {
      for (Index r = 0; r < width; ++r) {
        ApplyReflector(static_cast<int>(n - r),
                       &(*K)(begin + r, k_local + r),
                       (*tau)[k + r],
                       &(*K)(begin + r, j));
      }
    }
    V = panel.triangularView<Eigen::UnitLower>();
  }
  if (strips.communicator() == nullptr) return;
  VT_.resize(n + b, width);
  VT_.topRows(n) = V;
  VT_.bottomRows(b) = T_.leftCols(width);
  strips.communicator()->Broadcast(strips.Owner(k), VT_.data(), VT_.size());
  V = VT_.topRows(n);
  T_.leftCols(width) = VT_.bottomRows(b);
}

void BandReduction::ComputeW(const Communicator* communicator, Index begin) {
  constexpr Index b = kBandwidth;
  const Index n = next_VW_.rows() - begin;
  const Index width = std::min(n, b);
  auto V = next_VW_.block(begin, 0, n, width);
  auto X = next_VW_.block(begin, b, n, width);
  // Each rank computes its share of the rows of W.
  Share rows{0, static_cast<int>(n)};
  std::vector<std::ptrdiff_t> sizes;
  if (communicator != nullptr) {
    rows = communicator->OwnShare(static_cast<int>(n));
    sizes = communicator->SharedSizes(static_cast<int>(n), width);
    all_rows_ = X.transpose();
    own_rows_.resize(width, rows.count);
    communicator->SumParts(all_rows_.data(), sizes, own_rows_.data());
    X.middleRows(rows.first, rows.count) = own_rows_.transpose();
  }
  auto T = T_.topLeftCorner(width, width);
  auto S = S_.topLeftCorner(width, width);
  auto TS = TS_.topLeftCorner(width, width);
  WV_.bottomRows(n).setZero();
  auto W = WV_.block(begin, 0, n, width);
  auto own_V = V.middleRows(rows.first, rows.count);
  auto own_X = X.middleRows(rows.first, rows.count);
  auto own_W = W.middleRows(rows.first, rows.count);
  S_.setZero();
  Gemm(Op::kTranspose, Op::kNone, 1.0, own_V, own_X, 0.0, S);
  if (communicator != nullptr) communicator->Sum(S_.data(), S_.size());
  Gemm(Op::kTranspose, Op::kNone, 1.0, T, S, 0.0, TS);
  Gemm(Op::kNone, Op::kNone, -0.5, own_V, TS, 1.0, own_X);
  Gemm(Op::kNone, Op::kNone, 1.0, own_X, T, 0.0, own_W);
  if (communicator != nullptr) {
    own_rows_ = own_W.transpose();
    communicator->Gather(own_rows_.data(), sizes, all_rows_.data());
    W = all_rows_.transpose();
  }
  X = W;
  WV_.block(begin, b, n, width) = V;
}

}  // namespace invgrad
