#include "invgrad/core/small_svd.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "Eigen/SVD"
#include "invgrad/core/dense_svd.h"

namespace invgrad {

void SmallSvd::Compute(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  constexpr Eigen::Index kLargestForJacobi = 15;
  const bool is_finite = A.allFinite();
  if (is_finite && std::min(A.rows(), A.cols()) <= kLargestForJacobi) {
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(
        A, Eigen::ComputeThinU | Eigen::ComputeThinV);
    U = svd.matrixU();
    s = svd.singularValues();
    V = svd.matrixV();
    return;
  }
  DenseSvd svd;
  *svd.mutable_matrix() = A;
  if (!is_finite || !svd.Compute()) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    const Eigen::Index k = std::min(A.rows(), A.cols());
    U.setConstant(A.rows(), k, kNan);
    s.setConstant(k, kNan);
    V.setConstant(A.cols(), k, kNan);
    return;
  }
  U = svd.U();
  s = svd.s();
  V = svd.Vt().transpose();
}

Eigen::VectorXd SmallSvd::InversePowerTimes(
    double kappa,
    double tau,
    const Eigen::Ref<const Eigen::VectorXd>& w) const {
  Eigen::VectorXd coordinates = U.transpose() * w;
  for (Eigen::Index i = 0; i < s.size(); ++i) {
    coordinates[i] =
        s[i] > tau * s[0] ? coordinates[i] * std::pow(s[i], -kappa) : 0.0;
  }
  return V * coordinates;
}

}  // namespace invgrad
