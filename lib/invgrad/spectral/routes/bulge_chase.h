// Reduces a symmetric band matrix to tridiagonal form.
//
//   B = Q T Q^T,   B_ij = 0 for |i - j| > kBandwidth
//
// Sweep s makes column s tridiagonal by a reflector on the b = kBandwidth rows
// below its diagonal. Applied from both sides, this reflector fills a square
// below the band (the bulge). A reflector on the next b rows clears the first
// column of the square and fills the next square, and so on to the end [1].
// Later sweeps clear the other columns of the squares.
//
// A sweep reads the whole band for little arithmetic. Several sweeps therefore
// advance together, each one square behind the previous sweep, in a window of
// the band that stays in the cache.
//
// Shapes:  B: m x m;  T: diagonal m, off-diagonal m - 1;
//          about m^2 / (2 b) reflectors of b rows.
// Cost:    6 b m^2, 2 m^2 for a product with Q; m^2 / 2 numbers of memory.
//
// [1] Bischof, Lang, Sun. A framework for symmetric band reduction. ACM TOMS
//     26(4), 2000.
#ifndef INVGRAD_SPECTRAL_ROUTES_BULGE_CHASE_H_
#define INVGRAD_SPECTRAL_ROUTES_BULGE_CHASE_H_

#include <cstdint>

#include "Eigen/Core"
#include "invgrad/spectral/routes/aligned_buffer.h"

namespace invgrad {

class BulgeChase {
 public:
  // A narrow band makes the chase cheap, a wide band the band reduction, whose
  // matrix products have this width. At m = 4096, 32, 48 and 64 differ by 5 %,
  // and 48 is fastest.
  static constexpr int kBandwidth = 48;

  // Reads the diagonal of K and the kBandwidth diagonals below it.
  void Compute(const Eigen::MatrixXd& K,
               Eigen::VectorXd* diagonal,       // m
               Eigen::VectorXd* off_diagonal);  // m - 1

  // x = Q x, or Q^T x.
  void ApplyQ(bool transpose, Eigen::VectorXd* x) const;  // m

  // Memory kept between calls.
  static int64_t Bytes(int m);

 private:
  int size_ = 0;
  AlignedBuffer band_;
  AlignedBuffer reflectors_;
  AlignedBuffer tau_;
  mutable AlignedBuffer padded_x_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_BULGE_CHASE_H_
