#include "invgrad/chain/loss.h"

#include <cmath>

#include "glog/logging.h"

namespace invgrad {

SquaredNormLoss::SquaredNormLoss(int size, double factor)
    : size_(size), factor_(factor) {
  CHECK_GT(size, 0);
  CHECK(factor > 0.0 && std::isfinite(factor)) << factor;
}

bool SquaredNormLoss::Evaluate(const double* y,
                               const double* target,
                               double* loss,
                               double* gradient,
                               double* hessian) const {
  const Eigen::Map<const Eigen::VectorXd> y_map(y, size_);
  const Eigen::Map<const Eigen::VectorXd> target_map(target, size_);
  *loss = factor_ * (y_map - target_map).squaredNorm();
  if (gradient != nullptr) {
    Eigen::Map<Eigen::VectorXd>(gradient, size_) =
        2.0 * factor_ * (y_map - target_map);
  }
  if (hessian != nullptr) {
    Eigen::Map<Eigen::MatrixXd>(hessian, size_, size_) =
        2.0 * factor_ * Eigen::MatrixXd::Identity(size_, size_);
  }
  return std::isfinite(*loss);
}

DotProductLoss::DotProductLoss(int size) : size_(size) { CHECK_GT(size, 0); }

bool DotProductLoss::Evaluate(const double* y,
                              const double* target,
                              double* loss,
                              double* gradient,
                              double* hessian) const {
  const Eigen::Map<const Eigen::VectorXd> w(target, size_);
  *loss = w.dot(Eigen::Map<const Eigen::VectorXd>(y, size_));
  if (gradient != nullptr) Eigen::Map<Eigen::VectorXd>(gradient, size_) = w;
  if (hessian != nullptr) {
    Eigen::Map<Eigen::MatrixXd>(hessian, size_, size_).setZero();
  }
  return std::isfinite(*loss);
}

}  // namespace invgrad
