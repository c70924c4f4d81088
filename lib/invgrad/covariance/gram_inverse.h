// The inverse of A^T A of a sparse A with independent columns:
//
//   Z = (A^T A)^-1
//
// by a Cholesky decomposition (sparse_cholesky.h), or by a Schur complement
// where a few blocks of columns couple all others (schur_complement.h).
#ifndef INVGRAD_COVARIANCE_GRAM_INVERSE_H_
#define INVGRAD_COVARIANCE_GRAM_INVERSE_H_

#include <optional>
#include <utility>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

class GramInverse {
 public:
  virtual ~GramInverse() = default;

  // Z B.
  virtual Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const = 0;

  // For each pair (i, j) the entry Z_ij; none if it costs a solution.
  virtual std::vector<std::optional<double>> Entries(
      const std::vector<std::pair<int, int>>& entries) = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_COVARIANCE_GRAM_INVERSE_H_
