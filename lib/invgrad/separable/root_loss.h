// A residual block with a robust loss as a residual of least squares, and the
// weights by which the linear parameters are reweighted.
//
//   f = sqrt(rho(s) / s) r,   s = |r|^2:   |f|^2 = rho(s)
//   df = scale (dr + beta r (r^T dr)),   beta = (s rho' / rho - 1) / s
//   weight = sqrt(rho')
//
// df is the derivative of f: df^T f = rho' dr^T r, the exact gradient.
#ifndef INVGRAD_SEPARABLE_ROOT_LOSS_H_
#define INVGRAD_SEPARABLE_ROOT_LOSS_H_

#include <cmath>
#include <limits>

#include "ceres/loss_function.h"

namespace invgrad {

struct RootLoss {
  // loss: null is rho(s) = s.
  RootLoss(const ceres::LossFunction* loss, double s) : value(s) {
    if (loss == nullptr) return;
    double rho[3];
    loss->Evaluate(s, rho);
    value = rho[0];
    is_valid = rho[0] >= 0.0 && rho[1] >= 0.0 && std::isfinite(rho[0]);
    if (!is_valid) return;
    weight = scale = std::sqrt(rho[1]);
    // Near s = 0, rho(s) = rho'(0) s.
    if (s <= std::numeric_limits<double>::min() || rho[0] == 0.0) return;
    scale = std::sqrt(rho[0] / s);
    beta = (s * rho[1] / rho[0] - 1.0) / s;
  }

  bool is_valid = true;  // rho >= 0, rho' >= 0
  double value;          // rho
  double scale = 1.0;
  double beta = 0.0;
  double weight = 1.0;
};

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_ROOT_LOSS_H_
