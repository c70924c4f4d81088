#include "invgrad/core/hessian_times.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "invgrad/core/finite.h"

namespace invgrad {

namespace {

using Eigen::VectorXd;

bool HessianTimes(const VectorXd& x,
                  const VectorXd& v,
                  const LinearizeAfter& linearize_after,
                  VectorXd* Hv,
                  std::string* error) {
  const double length = v.lpNorm<Eigen::Infinity>();
  if (length == 0.0) {
    Hv->setZero(v.size());
    return true;
  }
  const double size = std::sqrt(std::max<double>(1.0, x.size()));
  const double scale = std::max(1.0, x.stableNorm() / size);
  const double relative = std::cbrt(std::numeric_limits<double>::epsilon());
  const double h = std::exp2(std::round(std::log2(relative * scale / length)));
  Linearization before, after;
  const LinearizationParts parts = LinearizationParts::Gradient();
  if (!linearize_after(h * v, parts, &after, error) ||
      !linearize_after(-h * v, parts, &before, error)) {
    return false;
  }
  *Hv = (after.gradient - before.gradient) / (2.0 * h);
  return CheckFinite("the product with the Hessian", *Hv, error);
}

}  // namespace

void AddProductsAndTrials(const LinearizationParts& parts,
                          const VectorXd& x,
                          LinearizeAfter after,
                          Linearization* linearization) {
  if (parts.hessian_times && !linearization->hessian_times) {
    linearization->hessian_times =
        [x, after](const VectorXd& v, VectorXd* Hv, std::string* error) {
          return HessianTimes(x, v, after, Hv, error);
        };
  }
  if (!parts.after) return;
  linearization->after = std::move(after);
  linearization->norm_of_x = x.stableNorm();
}

}  // namespace invgrad
