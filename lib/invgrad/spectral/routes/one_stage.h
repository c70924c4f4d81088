// Reduces a symmetric matrix to tridiagonal form, one column after the other.
//
//   K = Q T Q^T,   Q = H_0 H_1 ... H_{m-2},   H_j = I - tau_j u_j u_j^T
//
// This equals LAPACK's dsytrd (lower) up to rounding. Each column needs the
// product p = A u with the trailing matrix A, and a symmetric update of A of
// rank two:
//
//   w = tau p - 1/2 tau^2 (p^T u) u,   A -= u w^T + w u^T
//
// One sweep over the lower triangle both applies the update for one column and
// computes the product for the next [1]: each entry is loaded once for eight
// operations, which is fast while the triangle fits in the cache.
//
// Shapes:  K: m x m, its lower triangle is read;  u_j: m - 1 - j, below the
//          diagonal of K afterwards, without its leading one.
// Cost:    4/3 m^3; a copy of K.
//
// [1] Howell, Demmel, Fulton, Hammarling, Marmol. Cache efficient
//     bidiagonalization using BLAS 2.5 operators. ACM TOMS 34(3), 2008.
#ifndef INVGRAD_SPECTRAL_ROUTES_ONE_STAGE_H_
#define INVGRAD_SPECTRAL_ROUTES_ONE_STAGE_H_

#include <cstdint>

#include "Eigen/Core"
#include "invgrad/spectral/routes/aligned_buffer.h"

namespace invgrad {

class OneStageReduction {
 public:
  void Compute(Eigen::MatrixXd* K,
               Eigen::VectorXd* diagonal,      // m
               Eigen::VectorXd* off_diagonal,  // m - 1
               Eigen::VectorXd* tau);          // m - 1

  // Memory kept between calls.
  static int64_t Bytes(int m);

 private:
  AlignedBuffer buffer_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_ONE_STAGE_H_
