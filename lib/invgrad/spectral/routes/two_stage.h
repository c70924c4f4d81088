// The two stages that reduce a large symmetric matrix to tridiagonal form: to a
// band, and from the band to tridiagonal form [1].
//
//   K = Q B Q^T,   B_ij = 0 for |i - j| > b;   B = Q' T Q'^T
//
// Shapes:  K: m x m;  T: diagonal m, off-diagonal m - 1.
//
// [1] Bischof, Lang, Sun. A framework for symmetric band reduction. ACM TOMS
//     26(4), 2000.
#ifndef INVGRAD_SPECTRAL_ROUTES_TWO_STAGE_H_
#define INVGRAD_SPECTRAL_ROUTES_TWO_STAGE_H_

#include "Eigen/Core"
#include "invgrad/core/column_strips.h"
#include "invgrad/spectral/routes/simd.h"

namespace invgrad {

// b. A narrow band makes the chase cheap, a wide band the band reduction, whose
// matrix products have this width. At m = 4096, 32, 48 and 64 differ by 5 %,
// and 48 is fastest.
constexpr int kBandwidth = 48;

// Clears the b columns of a panel below the band by a QR factorization, with
// H = I - V T V^T. The trailing matrix becomes
//
//   H^T A H = A - V W^T - W V^T,   W = (X - 1/2 V T^T V^T X) T,   X = A V
//
// One sweep over the lower triangle, tile by tile, both applies the change by
// one panel and multiplies by V of the next panel. It reads each tile once for
// 8 b operations an entry, all in matrix products: 4/3 m^3 in total.
//
// With ranks, each sweeps its strips of columns: the products X are summed, and
// the owner of a panel factorizes it and sends V and T. A rank sends about 2 m^2
// numbers in all.
class BandReduction {
 public:
  // Reads the lower triangle of K, in this rank's strips. Afterwards the band of
  // K is that of B, and reflector j is below the band in rows j + b, ...; tau:
  // m - b, or none. The diagonal tiles of K also change above the diagonal.
  void Compute(const ColumnStrips& strips,
               Eigen::MatrixXd* K,
               Eigen::VectorXd* tau);

 private:
  // V and T of the panel of columns k, ..., to all ranks.
  void FactorizePanel(const ColumnStrips& strips,
                      Eigen::Index k,
                      Eigen::MatrixXd* K,
                      Eigen::VectorXd* tau);
  // From next [V X], with V in the rows from `begin` on: next [V W], and [W V].
  void ComputeW(const Communicator* communicator, Eigen::Index begin);

  // [V W] and [W V] of the last panel, [V X] of the next: rows are those of K.
  Eigen::MatrixXd VW_;       // m x 2 b
  Eigen::MatrixXd WV_;       // m x 2 b
  Eigen::MatrixXd next_VW_;  // m x 2 b
  // For the ranks: V over T; the rows of X or W of all ranks, and the own ones.
  Eigen::MatrixXd VT_;
  Eigen::MatrixXd all_rows_;  // transposed
  Eigen::MatrixXd own_rows_;  // transposed
  Eigen::MatrixXd T_;         // b x b
  Eigen::MatrixXd S_;         // b x b
  Eigen::MatrixXd TS_;        // b x b
};

// Sweep s makes column s tridiagonal by a reflector on the b rows below its
// diagonal. Applied from both sides, this reflector fills a square below the
// band (the bulge). A reflector on the next b rows clears the first column of
// the square and fills the next square, and so on to the end. Later sweeps
// clear the other columns of the squares: about m^2 / (2 b) reflectors of b
// rows and 6 b m^2 operations.
//
// A sweep reads the whole band for little arithmetic. Several sweeps therefore
// advance together, each one square behind the previous sweep, in a window of
// the band that stays in the cache.
class BulgeChase {
 public:
  // Reads the diagonal of K and the b diagonals below it. With ranks, the first
  // one computes and keeps the reflectors: the chase is serial.
  void Compute(const ColumnStrips& strips,
               const Eigen::MatrixXd& K,
               Eigen::VectorXd* diagonal,
               Eigen::VectorXd* off_diagonal);

  // x = Q' x, or Q'^T x.
  void ApplyQ(bool transpose, Eigen::VectorXd* x) const;

 private:
  int size_ = 0;
  const Communicator* communicator_ = nullptr;
  AlignedBuffer band_;
  AlignedBuffer reflectors_;
  AlignedBuffer tau_;
  mutable AlignedBuffer padded_x_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TWO_STAGE_H_
