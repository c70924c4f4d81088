#include "invgrad/internal/linear_projection.h"

namespace invgrad {

LinearProjection::LinearProjection(const Eigen::MatrixXd& Phi,
                                   double rank_threshold)
    : scale_(Phi.colwise().stableNorm().transpose()) {
  scale_ = (scale_.array() > 0.0).select(scale_, 1.0);
  decomposition_.setThreshold(rank_threshold);
  decomposition_.compute(Phi * scale_.cwiseInverse().asDiagonal());
  Q_1_ = decomposition_.householderQ() *
         Eigen::MatrixXd::Identity(Phi.rows(), decomposition_.rank());
}

Eigen::MatrixXd LinearProjection::Solve(const Eigen::MatrixXd& M) const {
  return scale_.cwiseInverse().asDiagonal() * decomposition_.solve(M);
}

Eigen::MatrixXd LinearProjection::SolveTransposed(
    const Eigen::MatrixXd& M) const {
  return decomposition_.transpose().solve(scale_.cwiseInverse().asDiagonal() *
                                          M);
}

Eigen::MatrixXd LinearProjection::Residual(const Eigen::MatrixXd& M) const {
  const Eigen::MatrixXd coordinates = Q_1_.transpose() * M;
  return M - Q_1_ * coordinates;
}

}  // namespace invgrad
