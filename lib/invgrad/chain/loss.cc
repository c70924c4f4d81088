#include "invgrad/loss.h"

#include <cmath>
#include <limits>

#include "invgrad/internal/logging.h"

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

void Loss::Retract(const double* y,
                   const double* t,
                   double eta,
                   double* moved,
                   double* velocity) const {
  const Eigen::Map<const VectorXd> y_map(y, size());
  const double radius = y_map.norm();
  VectorXd unit_y = y_map;
  VectorXd p = Eigen::Map<const VectorXd>(t, size());
  if (radius != 0.0) {
    unit_y /= radius;
    p -= unit_y.dot(p) * unit_y;
  }
  const double speed = p.norm();
  Eigen::Map<VectorXd> R(moved, size());
  Eigen::Map<VectorXd> dR(velocity, size());
  if (radius == 0.0 || speed == 0.0) {
    R = y_map;
    dR.setZero();
    return;
  }
  const double angle = eta * (speed / radius);
  R = std::cos(angle) * y_map + std::sin(angle) * (radius / speed) * p;
  dR = std::cos(angle) * p - std::sin(angle) * speed * unit_y;
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
