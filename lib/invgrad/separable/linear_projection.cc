#include "invgrad/separable/linear_projection.h"

namespace invgrad {

LinearProjection::LinearProjection(const Eigen::MatrixXd& Phi,
                                   double rank_threshold)
    : scale_(Phi.colwise().stableNorm().transpose()) {
  scale_ = (scale_.array() > 0.0).select(scale_, 1.0);
  decomposition_.setThreshold(rank_threshold);
  decomposition_.compute(Phi * scale_.cwiseInverse().asDiagonal());
}

Eigen::MatrixXd LinearProjection::Solve(const Eigen::MatrixXd& M) const {
  return scale_.cwiseInverse().asDiagonal() * decomposition_.solve(M);
}

Eigen::MatrixXd LinearProjection::SolveTransposed(
    const Eigen::MatrixXd& M) const {
  return decomposition_.transpose().solve(scale_.cwiseInverse().asDiagonal() *
                                          M);
}

Eigen::MatrixXd LinearProjection::Residual(Eigen::MatrixXd M) const {
  M.applyOnTheLeft(decomposition_.householderQ().adjoint());
  M.topRows(decomposition_.rank()).setZero();
  M.applyOnTheLeft(decomposition_.householderQ());
  return M;
}

}  // namespace invgrad
