// Reduces a symmetric matrix to a band.
//
//   K = Q B Q^T,   B_ij = 0 for |i - j| > b
//
// The b columns of a panel are cleared below the band by a QR factorization,
// with H = I - V T V^T, and the trailing matrix becomes [1]
//
//   H^T A H = A - V W^T - W V^T,   W = (X - 1/2 V T^T V^T X) T,   X = A V
//
// One sweep over the lower triangle, tile by tile, both applies the change by
// one panel and multiplies by V of the next panel. It reads each tile once for
// 8 b operations an entry, all in matrix products.
//
// Shapes:  K: m x m, its lower triangle is read;  reflector j: rows j + b, ...,
//          below the band of K afterwards.
// Cost:    4/3 m^3 + O(b m^2); 6 b m numbers of memory.
//
// [1] Bischof, Lang, Sun. A framework for symmetric band reduction. ACM TOMS
//     26(4), 2000.
#ifndef INVGRAD_SPECTRAL_ROUTES_BAND_REDUCTION_H_
#define INVGRAD_SPECTRAL_ROUTES_BAND_REDUCTION_H_

#include <cstdint>

#include "Eigen/Core"

namespace invgrad {

class BandReduction {
 public:
  // The band of K becomes the band of B. The diagonal tiles of K also change
  // above the diagonal.
  void Compute(int bandwidth,
               Eigen::MatrixXd* K,
               Eigen::VectorXd* tau);  // m - b, or none

  // Memory kept between calls.
  static int64_t Bytes(int m, int bandwidth);

 private:
  // [V W] and [W V] of the last panel, [V X] of the next: rows are those of K.
  Eigen::MatrixXd VW_;       // m x 2 b
  Eigen::MatrixXd WV_;       // m x 2 b
  Eigen::MatrixXd next_VW_;  // m x 2 b
  Eigen::MatrixXd T_;        // b x b
  Eigen::MatrixXd S_;        // b x b
  Eigen::MatrixXd TS_;       // b x b
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_BAND_REDUCTION_H_
