#include "invgrad/core/small_svd.h"

#include "Eigen/SVD"

namespace invgrad {

void SmallSvd::Compute(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(
      A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  U = svd.matrixU();
  s = svd.singularValues();
  V = svd.matrixV();
}

}  // namespace invgrad
