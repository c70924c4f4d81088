// Eigenvalue counts and resolvents of a symmetric tridiagonal matrix, for many
// shifts at a time. They give functions of the matrix without eigenvectors.
//
//   T = diag(a) + diag(e, -1) + diag(e, 1),   y = sum_j Im[c_j (z_j - T)^-1] h
//
// Shapes:  a, h, y: m;  e: m - 1;  z, c: any number.
// Units:   entries of order one (within 1e+-100, say), because e is squared.
// Cost:    about 4 cycles a row and shift for counts and 15 for resolvents on
//          AVX2; each perturbation adds half a solution. 640 m bytes.
// Accuracy: a count is exact for a T with relative perturbations of a few
//          epsilon in each entry [1]; a solution, by partial pivoting, for a
//          perturbation of T by a few epsilon (|T| + |z_j|).
// Fails:   never; a T with NaN gives NaN, and meaningless counts.
//
// [1] Demmel, Dhillon, Ren. On the correctness of some bisection-like parallel
//     eigenvalue algorithms in floating point arithmetic. ETNA 3 (1995).
#ifndef INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_H_
#define INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_H_

#include <complex>
#include <vector>

#include "Eigen/Core"
#include "invgrad/spectral/routes/simd.h"

namespace invgrad {

class Tridiagonal {
 public:
  // Copies a (at least one entry) and e (one entry less). Reuses its memory
  // between calls.
  void Set(const Eigen::VectorXd& diagonal,
           const Eigen::VectorXd& off_diagonal);

  int size() const { return size_; }

  // An interval that contains all eigenvalues (Gershgorin).
  double lower_bound() const { return lower_bound_; }
  double upper_bound() const { return upper_bound_; }

  // counts[k] = the number of eigenvalues < shifts[k].
  void CountBelow(const double* shifts, int num_shifts, int* counts) const;

  // Eigenvalue number `index` in ascending order, from 0, to a few roundings of
  // the largest eigenvalue.
  double Eigenvalue(int index) const;
  // The same to `tolerance`, if it lies in [low, high].
  double Eigenvalue(int index, double low, double high, double tolerance) const;

  // y = T x.
  void Times(const Eigen::VectorXd& x, Eigen::VectorXd* y) const;

  // Perturbations of T by size E_p, p = 0 .. 3,
  //   E_p = (u_p v_p^T + v_p u_p^T) / sqrt(2):
  // column i holds entries i of u_0, v_0, u_1, ... With entries +-1 drawn at
  // random, E_p is a symmetric matrix whose entries have variance one.
  static constexpr int kNumPerturbations = 4;
  using Perturbations =
      Eigen::Matrix<double, 2 * kNumPerturbations, Eigen::Dynamic>;
  using Changes = Eigen::Matrix<double, Eigen::Dynamic, kNumPerturbations>;

  // With `perturbations` not null, column p of *changes (m x 4) is the
  // derivative of y in the size of E_p.
  void ApplyResolvents(const std::vector<std::complex<double>>& z,
                       const std::vector<std::complex<double>>& c,
                       const Eigen::VectorXd& h,
                       Eigen::VectorXd* y,
                       const Perturbations* perturbations,
                       Changes* changes);

 private:
  int size_ = 0;
  Eigen::VectorXd diagonal_;              // m + 1: a last zero
  Eigen::VectorXd off_diagonal_;          // m + 1: two last zeros
  Eigen::VectorXd squared_off_diagonal_;  // m: a first zero
  double lower_bound_ = 0.0;
  double upper_bound_ = 0.0;
  AlignedBuffer rows_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_H_
