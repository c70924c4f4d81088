// LAPACK's thin singular value decomposition gesdd, in double or single
// precision, to compare the routes of spectral_step.h with.
#ifndef BIN_BENCH_LAPACK_SVD_H_
#define BIN_BENCH_LAPACK_SVD_H_

#include <lapacke.h>

#include <algorithm>
#include <type_traits>

#include "Eigen/Core"
#include "invgrad/spectral.h"

namespace invgrad {

// V phi(S) U^T g in the precision of an SVD with members U, s and Vt.
template <typename Svd>
Eigen::VectorXd FilteredStep(const Svd& svd,
                             const SpectralFilter& filter,
                             const Eigen::VectorXd& g) {
  using Scalar = typename Svd::Matrix::Scalar;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> c =
      svd.U.transpose() * g.cast<Scalar>();
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    c[i] *= static_cast<Scalar>(filter(svd.s[i], svd.s[0]));
  }
  return (svd.Vt.transpose() * c).template cast<double>();
}

// J = U diag(s) Vt. A second decomposition of a size allocates nothing.
template <typename Scalar>
struct LapackSvd {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

  // Returns false if the iteration does not converge.
  bool Compute(const Matrix& J) {
    const auto m = static_cast<int>(J.rows());
    const auto n = static_cast<int>(J.cols());
    const int k = std::min(m, n);
    overwritten = J;
    U.resize(m, k);
    s.resize(k);
    Vt.resize(k, n);
    const auto gesdd = [&](auto lapacke) {
      return lapacke(LAPACK_COL_MAJOR,
                     'S',
                     m,
                     n,
                     overwritten.data(),
                     m,
                     s.data(),
                     U.data(),
                     m,
                     Vt.data(),
                     k) == 0;
    };
    if constexpr (std::is_same_v<Scalar, double>) {
      return gesdd(LAPACKE_dgesdd);
    } else {
      return gesdd(LAPACKE_sgesdd);
    }
  }

  Matrix overwritten, U, Vt;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> s;
};

}  // namespace invgrad

#endif  // BIN_BENCH_LAPACK_SVD_H_
