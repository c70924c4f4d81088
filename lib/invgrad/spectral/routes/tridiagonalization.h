// Reduces a symmetric matrix to tridiagonal form.
//
//   K = Q T Q^T,   Q orthogonal, a product of Householder reflectors
//
// A function of K applied to a vector, f(K) g = Q f(T) Q^T g, takes two
// products with Q and no eigenvectors of K.
//
// Large matrices take two stages (two_stage.h), small ones a single stage, which
// equals LAPACK's dsytrd (lower) up to rounding: column j needs the product
// p = A u with the trailing matrix A, and A -= u w^T + w u^T with
// w = tau p - 1/2 tau^2 (p^T u) u. One sweep over the lower triangle both
// applies the update for one column and computes the product for the next [1]:
// each entry is loaded once for eight operations, which is fast while the
// triangle fits in the cache. LAPACK's dsytrd takes 1.6 to 2.3 times as long at
// m = 128 to 1,024; its two-stage form does not apply Q, and its band reduction
// (dsytrd_sy2sb) takes 1.2 to 1.4 times as long at m = 4096.
//
// Shapes:  K: m x m, of which the lower triangle is read;  Q: m x m;
//          T: diagonal m, off-diagonal m - 1.
// Units:   T has the units of K. Squares and products of entries must neither
//          over- nor underflow: first scale K to entries of order one.
// Cost:    4/3 m^3, in two stages by BLAS and its threads; 2 m^2 (one stage) or
//          4 m^2 (two stages) for each product of Q and a vector.
// Fails:   never; a K that is not finite gives a T that is not finite.
// Threads: one thread at a time may use an object, also for ApplyQ.
// Ranks:   two stages; each rank holds its strips of K (column_strips.h), and
//          the first one the reflectors of the second stage, m^2 / 2. A rank
//          sends about 2 m^2 numbers, and m^2 / 192 for a product with Q.
//
// [1] Howell, Demmel, Fulton, Hammarling, Marmol. Cache efficient
//     bidiagonalization using BLAS 2.5 operators. ACM TOMS 34(3), 2008.
#ifndef INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_
#define INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_

#include "Eigen/Core"
#include "invgrad/core/column_strips.h"
#include "invgrad/spectral/routes/simd.h"
#include "invgrad/spectral/routes/two_stage.h"

namespace invgrad {

class Tridiagonalization {
 public:
  enum class Method { kAuto, kOneStage, kTwoStage };

  // Reduces the symmetric matrix whose lower triangle K holds. Overwrites K
  // with the reflectors; K must stay alive and unchanged while Q is applied. A
  // second matrix of the same size allocates nothing.
  void Compute(Eigen::MatrixXd* K, Method method = Method::kAuto);
  // The same with K in strips: always two stages, if there are ranks.
  void ComputeStrips(const ColumnStrips& strips, Eigen::MatrixXd* K);

  const Eigen::VectorXd& diagonal() const { return diagonal_; }
  const Eigen::VectorXd& off_diagonal() const { return off_diagonal_; }

  // x = Q^T x and x = Q x.
  void ApplyQTranspose(Eigen::VectorXd* x) const;  // m
  void ApplyQ(Eigen::VectorXd* x) const;           // m

  // The approximate memory kept for a matrix of size m, in addition to K.
  static double Bytes(double m, Method method = Method::kAuto);

 private:
  void ReduceInTwoStages(const ColumnStrips& strips);
  void ReduceInOneStage();
  // The reflectors in K: those of one stage, or of the band reduction.
  void ApplyReflectors(bool transpose, Eigen::VectorXd* x) const;

  Eigen::MatrixXd* K_ = nullptr;       // holds the reflectors
  ColumnStrips strips_{0, nullptr};    // of K
  Method method_ = Method::kOneStage;  // never kAuto
  Eigen::VectorXd diagonal_;           // m
  Eigen::VectorXd off_diagonal_;       // m - 1
  Eigen::VectorXd tau_;                // of the reflectors in K
  AlignedBuffer triangle_;             // of one stage
  BandReduction band_reduction_;
  BulgeChase bulge_chase_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_
