// The Cholesky decomposition of A^T A, and entries of the inverse.
//
//   P A^T A P^T = L L^T,   Z = (A^T A)^-1
//
// Solve computes columns of Z. Entries computes the entries of Z in the
// pattern of L by Takahashi's recurrence [1, 2], from the last column of L to
// the first one that is needed:
//
//   Z_jj = (1 / L_jj - sum_k Z_jk L_kj) / L_jj,
//   Z_ij = -sum_k Z_ik L_kj / L_jj,           i, k > j in the pattern of L_j
//
// Two columns of A that share a row are in the pattern.
//
// Shapes:  A: m x n, sparse;  L: n x n.
// Cost:    Factorize: one decomposition by CHOLMOD with the ordering AMD, which
//          does not form A^T A. Solve: 4 |L| for a column. Entries: the
//          sum over the columns j of L of |L_k| over all k in the pattern of
//          L_j, without BLAS.
// Fails:   Factorize returns false with a message if memory does not suffice or
//          if A^T A is not positive definite to rounding.
//
// [1] Takahashi, Fagan, Chin. Formation of a sparse bus impedance matrix and
//     its application to short circuit study. PICA (1973).
// [2] Erisman, Tinney. On computing certain elements of the inverse of a sparse
//     matrix. Comm. ACM 18 (1975).
#ifndef INVGRAD_COVARIANCE_SPARSE_CHOLESKY_H_
#define INVGRAD_COVARIANCE_SPARSE_CHOLESKY_H_

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/covariance/gram_inverse.h"

namespace invgrad {

class CholmodFactor;

class SparseCholesky final : public GramInverse {
 public:
  SparseCholesky();
  ~SparseCholesky() override;

  bool Factorize(const Eigen::SparseMatrix<double>& A, std::string* error);

  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const override;

  // Those in the pattern of L. Converts L, so that a later Solve takes longer.
  std::vector<std::optional<double>> Entries(
      const std::vector<std::pair<int, int>>& entries) override;

 private:
  std::unique_ptr<CholmodFactor> factor_;
};

}  // namespace invgrad

#endif  // INVGRAD_COVARIANCE_SPARSE_CHOLESKY_H_
