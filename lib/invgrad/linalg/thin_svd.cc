#include "invgrad/linalg/thin_svd.h"

#include "Eigen/SVD"

namespace invgrad {

void ThinSvd::Compute(const Eigen::Ref<const Eigen::MatrixXd>& A) {
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(
      A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  U = svd.matrixU();
  s = svd.singularValues();
  V = svd.matrixV();
}

}  // namespace invgrad
