// Cholesky factors of the shifted normal equations of a sparse J.
//
//   P (J^T J + shift I) P^T = L L^T
//
// P, a fill-reducing permutation, and the pattern of L are computed once for a
// pattern of J, and reused for all shifts and all later J with this pattern.
//
// Shapes:  J: m x n;  x: n.
// Cost:    CHOLMOD [1], supernodal if L has large dense blocks. A pose graph
//          with n = 15,000 has 2 million entries in L.
// Fails:   returns false, with a message, if L needs more memory than allowed
//          or J^T J + shift I is not positive definite to rounding.
//
// [1] Chen, Davis, Hager, Rajamanickam. Algorithm 887: CHOLMOD. ACM TOMS 35
//     (2008).
#ifndef INVGRAD_RANK_SPARSE_CHOLESKY_H_
#define INVGRAD_RANK_SPARSE_CHOLESKY_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"

namespace invgrad {

class SparseCholesky {
 public:
  SparseCholesky();
  ~SparseCholesky();
  SparseCholesky(SparseCholesky&&) noexcept;
  SparseCholesky& operator=(SparseCholesky&&) noexcept;

  // Analyzes the pattern of J, unless it is unchanged since the last call.
  // Keeps a reference to the values: J must outlive the calls below.
  // memory_limit: for L in bytes; 0: the limit of memory_limit.h.
  bool Analyze(const SparseJacobian& J,
               double memory_limit,
               std::string* error);

  // CHECKs that J was analyzed, and shift >= 0.
  bool Factorize(double shift, std::string* error);

  // x = (J^T J + shift I)^-1 x for each column of x, with the shift of the last
  // Factorize.
  void Solve(Eigen::Ref<Eigen::MatrixXd> x) const;

  // Entries of L.
  double num_entries() const;

 private:
  class Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace invgrad

#endif  // INVGRAD_RANK_SPARSE_CHOLESKY_H_
