// Reduces a symmetric matrix to tridiagonal form.
//
//   K = Q T Q^T,   Q orthogonal, a product of Householder reflectors
//
// A function of K applied to a vector, f(K) g = Q f(T) Q^T g, takes two
// products with Q and no eigenvectors of K.
//
// Small matrices take one stage (one_stage.h), large ones two: matrix products
// reduce K to a band (band_reduction.h), and bulge chasing reduces the band to
// tridiagonal form (bulge_chase.h). Two stages do more arithmetic, but are
// faster if K does not fit in the cache. LAPACK's dsytrd takes 1.6 to 2.3 times
// as long at m = 128 to 1,024, and its two-stage form does not apply Q.
//
// Shapes:  K: m x m, of which the lower triangle is read;  Q: m x m;
//          T: diagonal m, off-diagonal m - 1.
// Units:   T has the units of K. Squares and products of entries must neither
//          over- nor underflow: first scale K to entries of order one.
// Cost:    4/3 m^3 for Compute; 2 m^2 (one stage) or 4 m^2 (two stages) for
//          each product of Q and a vector. Two stages use BLAS and its threads.
// Fails:   never; a K that is not finite gives a T that is not finite.
// Threads: one thread at a time may use an object, also for ApplyQ, which
//          shares the buffers.
#ifndef INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_
#define INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_

#include <cstdint>

#include "Eigen/Core"
#include "invgrad/spectral/routes/band_reduction.h"
#include "invgrad/spectral/routes/bulge_chase.h"
#include "invgrad/spectral/routes/one_stage.h"

namespace invgrad {

class Tridiagonalization {
 public:
  enum class Method { kAuto, kOneStage, kTwoStage };

  // Reduces the symmetric matrix whose lower triangle K holds. Overwrites K
  // with the reflectors; K must stay alive and unchanged while Q is applied. A
  // second matrix of the same size allocates nothing.
  void Compute(Eigen::MatrixXd* K, Method method = Method::kAuto);

  const Eigen::VectorXd& diagonal() const { return diagonal_; }
  const Eigen::VectorXd& off_diagonal() const { return off_diagonal_; }

  // x = Q^T x and x = Q x.
  void ApplyQTranspose(Eigen::VectorXd* x) const;  // m
  void ApplyQ(Eigen::VectorXd* x) const;           // m

  // The memory kept for a matrix of size m, in addition to K.
  static int64_t Bytes(int m, Method method = Method::kAuto);

 private:
  const Eigen::MatrixXd* K_ = nullptr;  // holds the reflectors
  Method method_ = Method::kOneStage;   // never kAuto
  Eigen::VectorXd diagonal_;            // m
  Eigen::VectorXd off_diagonal_;        // m - 1
  Eigen::VectorXd tau_;                 // of the reflectors in K
  OneStageReduction one_stage_;
  BandReduction band_reduction_;
  BulgeChase bulge_chase_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TRIDIAGONALIZATION_H_
