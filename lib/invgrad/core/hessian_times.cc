#include "invgrad/core/hessian_times.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "glog/logging.h"
#include "invgrad/core/finite.h"

namespace invgrad {

namespace {

using Eigen::VectorXd;

bool HessianTimes(const VectorXd& x,
                  const VectorXd& v,
                  const GradientAfter& gradient_after,
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
  VectorXd behind;
  if (!gradient_after(h * v, Hv, error) ||
      !gradient_after(-h * v, &behind, error)) {
    return false;
  }
  *Hv = (*Hv - behind) / (2.0 * h);
  return CheckFinite("the product with the Hessian", *Hv, error);
}

}  // namespace

void AddHessianTimes(const VectorXd& x,
                     GradientAfter gradient_after,
                     Linearization* linearization) {
  linearization->hessian_times =
      [x, gradient_after = std::move(gradient_after)](
          const VectorXd& v, VectorXd* Hv, std::string* error) {
        return HessianTimes(x, v, gradient_after, Hv, error);
      };
}

void AddHessianTimes(Objective* objective, Linearization* linearization) {
  if (linearization->hessian_times) return;
  linearization->hessian_times =
      [objective](const VectorXd& v, VectorXd* Hv, std::string* error) {
        CHECK_EQ(v.size(), objective->num_parameters());
        const VectorXd state = objective->State();
        const auto gradient_after =
            [&](const VectorXd& step, VectorXd* gradient, std::string* why) {
              Linearization after;
              bool has_gradient = objective->Plus(step);
              if (!has_gradient) {
                *why = "the point cannot be moved for a difference";
              } else {
                has_gradient = objective->Linearize(
                    LinearizationParts::Gradient(), &after, why);
              }
              objective->SetState(state);
              *gradient = std::move(after.gradient);
              return has_gradient;
            };
        return HessianTimes(state, v, gradient_after, Hv, error);
      };
}

}  // namespace invgrad
