#include "invgrad/chain/loss.h"

#include <cmath>
#include <limits>

#include "glog/logging.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd Loss::HessianTimes(const double* y,
                            const double* target,
                            const VectorXd& v) const {
  CHECK(forms_hessian());
  double ignored = 0.0;
  MatrixXd hessian(size(), size());
  if (!Evaluate(y, target, &ignored, nullptr, hessian.data())) {
    return VectorXd::Constant(size(), std::numeric_limits<double>::quiet_NaN());
  }
  return hessian * v;
}

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
  const Eigen::Map<const VectorXd> y_map(y, size_);
  const Eigen::Map<const VectorXd> target_map(target, size_);
  *loss = factor_ * (y_map - target_map).squaredNorm();
  if (gradient != nullptr) {
    Eigen::Map<VectorXd>(gradient, size_) =
        2.0 * factor_ * (y_map - target_map);
  }
  if (hessian != nullptr) {
    Eigen::Map<MatrixXd>(hessian, size_, size_) =
        2.0 * factor_ * MatrixXd::Identity(size_, size_);
  }
  return std::isfinite(*loss);
}

DotProductLoss::DotProductLoss(int size) : size_(size) { CHECK_GT(size, 0); }

bool DotProductLoss::Evaluate(const double* y,
                              const double* target,
                              double* loss,
                              double* gradient,
                              double* hessian) const {
  const Eigen::Map<const VectorXd> w(target, size_);
  *loss = w.dot(Eigen::Map<const VectorXd>(y, size_));
  if (gradient != nullptr) Eigen::Map<VectorXd>(gradient, size_) = w;
  if (hessian != nullptr) {
    Eigen::Map<MatrixXd>(hessian, size_, size_).setZero();
  }
  return std::isfinite(*loss);
}

}  // namespace invgrad
