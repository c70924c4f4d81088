#include "invgrad/linalg/band_reduction.h"

#include <lapacke.h>

#include <algorithm>

#include "glog/logging.h"
#include "invgrad/linalg/blas.h"
#include "invgrad/linalg/householder.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Ref;
using Eigen::VectorXd;

#ifndef TW
#define TW 128
#define TH 512
#endif
constexpr Index kTileWidth = TW;
constexpr Index kTileHeight = TH;

// Makes the tiles on the diagonal full.
void MirrorDiagonalTiles(MatrixXd* K) {
  const Index m = K->rows();
  for (Index first = 0; first < m; first += kTileWidth) {
    const Index end = std::min(m, first + kTileWidth);
    for (Index j = first; j < end; ++j) {
      for (Index i = first; i < j; ++i) (*K)(i, j) = (*K)(j, i);
    }
  }
}

// The tiles of the lower triangle of K from row `begin` on, by columns:
// A -= [V W] [W V]^T, unless VW is null, and X = A V of [V X].
void Sweep(Index begin,
           const MatrixXd* VW,
           const MatrixXd& WV,
           MatrixXd* K,
           MatrixXd* VX) {
  const Index m = K->rows();
  const Index b = VX->cols() / 2;
  auto V = VX->leftCols(b);
  auto X = VX->rightCols(b);
  X.bottomRows(m - begin).setZero();
  for (Index j = begin; j < m;) {
    const Index end = std::min(m, (j / kTileWidth + 1) * kTileWidth);
    const Index cols = end - j;
    for (Index i = j; i < m;) {
      const Index rows = i == j ? cols : std::min(kTileHeight, m - i);
      auto A = K->block(i, j, rows, cols);
      if (VW != nullptr) {
        Gemm(Op::kNone,
             Op::kTranspose,
             -1.0,
             VW->middleRows(i, rows),
             WV.middleRows(j, cols),
             1.0,
             A);
      }
      Gemm(Op::kNone,
           Op::kNone,
           1.0,
           A,
           V.middleRows(j, cols),
           1.0,
           X.middleRows(i, rows));
      if (i != j) {
        Gemm(Op::kTranspose,
             Op::kNone,
             1.0,
             A,
             V.middleRows(i, rows),
             1.0,
             X.middleRows(j, cols));
      }
      i += rows;
    }
    j = end;
  }
}

}  // namespace

void BandReduction::Compute(int bandwidth, MatrixXd* K, VectorXd* tau) {
  CHECK_EQ(K->rows(), K->cols());
  const Index m = K->rows();
  const Index b = bandwidth;
  tau->resize(std::max<Index>(0, m - b));
  if (m <= b) return;
  VW_.resize(m, 2 * b);
  WV_.resize(m, 2 * b);
  next_VW_.resize(m, 2 * b);
  T_.resize(b, b);
  S_.resize(b, b);
  TS_.resize(b, b);
  MirrorDiagonalTiles(K);

  bool pending = false;
  for (Index k = 0; k < m; k += b) {
    const Index begin = k + b;  // of the rows that the panel clears
    const bool last = begin >= m;
    const Index cols = last ? m - k : b;
    if (pending) {
      Gemm(Op::kNone,
           Op::kTranspose,
           -1.0,
           VW_.bottomRows(m - k),
           WV_.middleRows(k, cols),
           1.0,
           K->block(k, k, m - k, cols));
    }
    if (last) break;

    const Index n = m - begin;
    const Index width = std::min(n, b);  // the number of reflectors
    auto panel = K->block(begin, k, n, width);
    LAPACKE_dgeqrt3_work(LAPACK_COL_MAJOR,
                         static_cast<int>(n),
                         static_cast<int>(width),
                         panel.data(),
                         static_cast<int>(m),
                         T_.data(),
                         static_cast<int>(b));
    T_.triangularView<Eigen::StrictlyLower>().setZero();
    tau->segment(k, width) = T_.diagonal().head(width);

    // A panel that is wider than high: what is right of the square.
    for (Index j = k + width; j < begin; ++j) {
      for (Index r = 0; r < width; ++r) {
        ApplyReflector(static_cast<int>(n - r),
                       &(*K)(begin + r, k + r),
                       (*tau)[k + r],
                       &(*K)(begin + r, j));
      }
    }

    auto V = next_VW_.block(begin, 0, n, width);
    auto X = next_VW_.block(begin, b, n, width);
    next_VW_.bottomRows(n).setZero();
    V = panel.triangularView<Eigen::UnitLower>();

    Sweep(begin, pending ? &VW_ : nullptr, WV_, K, &next_VW_);

    auto T = T_.topLeftCorner(width, width);
    auto S = S_.topLeftCorner(width, width);
    auto TS = TS_.topLeftCorner(width, width);
    auto W = WV_.block(begin, 0, n, width);
    Gemm(Op::kTranspose, Op::kNone, 1.0, V, X, 0.0, S);
    Gemm(Op::kTranspose, Op::kNone, 1.0, T, S, 0.0, TS);
    Gemm(Op::kNone, Op::kNone, -0.5, V, TS, 1.0, X);
    WV_.bottomRows(n).setZero();
    Gemm(Op::kNone, Op::kNone, 1.0, X, T, 0.0, W);
    X = W;
    WV_.block(begin, b, n, width) = V;
    VW_.swap(next_VW_);
    pending = true;
  }
}

int64_t BandReduction::Bytes(int m, int bandwidth) {
  const int64_t b = bandwidth;
  return static_cast<int64_t>(sizeof(double)) * (6 * b * m + 3 * b * b);
}

}  // namespace invgrad
