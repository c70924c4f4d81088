// A Ceres cost function that also computes second derivatives.
//
//   H = sum_i w_i d2r_i/dx2
//
// Shapes:  w: m, one weight for each residual; H: n x n, symmetric, with the
//          parameter blocks one after the other; n: the sum of their ambient
//          sizes.
// Fails:   as Evaluate.
//
// AutoDiffSecondOrderCostFunction (autodiff_second_order_cost_function.h)
// computes H by automatic differentiation.
#ifndef INVGRAD_SECOND_ORDER_COST_FUNCTION_H_
#define INVGRAD_SECOND_ORDER_COST_FUNCTION_H_

#include "ceres/cost_function.h"

namespace invgrad {

class SecondOrderCostFunction : public ceres::CostFunction {
 public:
  // Computes H (n x n; symmetric, so row-major or column-major) at
  // `parameters` (one pointer a block) for the weights `w` (m).
  virtual bool WeightedHessian(const double* const* parameters,
                               const double* w,
                               double* hessian) const = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_SECOND_ORDER_COST_FUNCTION_H_
