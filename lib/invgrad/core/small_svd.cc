#include "invgrad/core/small_svd.h"

#include <cmath>

#include "Eigen/SVD"

namespace invgrad {

void SmallSvd::Compute(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(
      A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  U = svd.matrixU();
  s = svd.singularValues();
  V = svd.matrixV();
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
