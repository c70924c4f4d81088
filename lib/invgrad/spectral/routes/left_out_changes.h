// What a resolvent of a Gram matrix does to the outputs of one sample, with the
// sample and without it, for many shifts.
//
//   fitted(z)   = (G (G + z)^-1 r)_i
//   left_out(z) = J_i J_-i^T (G_-i,-i + z)^-1 r_-i,   G = J J^T,
//
// from a tridiagonal form of G or of J^T J (docs/leave_one_out.md). With
// A = W^T (T + z)^-1 W and v = W^T (T + z)^-1 (W r_i - b):
//
//   m <= n: G = Q T Q^T,      W = (Q^T)_i,     b = Q^T r:
//           left_out = A^-1 v,        fitted = r_i - z (A r_i - v)
//   n < m:  J^T J = Q T Q^T,  W = Q^T J_i^T,   b = Q^T J^T r:
//           left_out = -(I - A)^-1 v, fitted = A r_i - v
//
// W^T (W r_i - b) = 0 for m <= n, so that v loses digits for z well above T; from
// z = |T| on it is taken as -W^T (T + z)^-1 T (W r_i - b) / z, which loses none.
// With T + z = L D L^T, A and v are products of D^-1/2 L^-1 W: one sweep, and no
// backward substitution.
//
// Shapes:  T: k x k;  W: k x q, q the rows of the sample;  b: k;  r_i: q;
//          results: q x number of shifts.
// Units:   T with entries of order one.
// Cost:    k (q^2 / 2 + 4 q) multiplications a shift, four shifts at a time.
// Fails:   never. T + z must be positive definite beyond rounding (for n < m,
//          z well above epsilon |T|).
#ifndef INVGRAD_SPECTRAL_ROUTES_LEFT_OUT_CHANGES_H_
#define INVGRAD_SPECTRAL_ROUTES_LEFT_OUT_CHANGES_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/spectral/routes/simd.h"
#include "invgrad/spectral/routes/tridiagonal.h"

namespace invgrad {

class LeftOutChanges {
 public:
  // Factorizes T + z for all shifts: at least one, ascending.
  LeftOutChanges(const Eigen::VectorXd& diagonal,
                 const Eigen::VectorXd& off_diagonal,
                 const std::vector<double>& shifts,
                 bool is_parameter_side);

  void Compute(const Eigen::Ref<const Eigen::MatrixXd>& W,
               const Eigen::VectorXd& b,
               const Eigen::Ref<const Eigen::VectorXd>& r_i,
               Eigen::MatrixXd* left_out,
               Eigen::MatrixXd* fitted);

 private:
  Tridiagonal T_;
  int size_;  // k
  Eigen::Index num_shifts_;
  std::vector<double> shifts_;  // whole groups of four
  bool is_parameter_side_;
  // Of each group of four shifts and each row of T: L's entry to the left of
  // its diagonal, then D's inverse.
  AlignedBuffer factors_;
  AlignedBuffer work_;
  Eigen::VectorXd h_;   // W r_i - b
  Eigen::VectorXd Th_;  // T h
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_LEFT_OUT_CHANGES_H_
