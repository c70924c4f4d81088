// The thin singular value decomposition of a small dense matrix, such as the
// Jacobian of the simulator for one sample.
//
//   A = U diag(s) V^T
//
// Shapes:  A: m x n;  U: m x k;  s: k, descending;  V: n x k;  k = min(m, n).
// Cost:    about 4 m n k + 22 k^3, for k < 16 by Jacobi's method, otherwise by
//          dense_svd.h.
// Fails:   s has NaN if A has.
//
// For batches see spectral.h.
#ifndef INVGRAD_CORE_SMALL_SVD_H_
#define INVGRAD_CORE_SMALL_SVD_H_

#include "Eigen/Core"

namespace invgrad {

struct SmallSvd {
  Eigen::MatrixXd U;
  Eigen::VectorXd s;
  Eigen::MatrixXd V;

  void Compute(const Eigen::Ref<const Eigen::MatrixXd>& A);

  // V s^-kappa U^T w over s > tau s_max; zero if A is.
  Eigen::VectorXd InversePowerTimes(
      double kappa,
      double tau,
      const Eigen::Ref<const Eigen::VectorXd>& w) const;
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_SMALL_SVD_H_
