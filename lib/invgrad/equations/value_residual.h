// A condition on the values of a function: y = u - c, with c the context.
//
// For terms of an equation (equation.h) beside the equation itself: values at a
// boundary, measurements.
// Shapes:  y: 1; u is the first function.
#ifndef INVGRAD_EQUATIONS_VALUE_RESIDUAL_H_
#define INVGRAD_EQUATIONS_VALUE_RESIDUAL_H_

#include <algorithm>
#include <cmath>

#include "invgrad/simulator.h"
#include "invgrad/trial_function.h"

namespace invgrad {

class ValueResidual final : public Simulator {
 public:
  // Of an equation with this trial function and number of coefficients.
  explicit ValueResidual(const TrialFunction& trial, int num_coefficients = 0)
      : num_inputs_(trial.num_functions * trial.derivatives->num_stated() +
                    num_coefficients) {}

  int num_inputs() const override { return num_inputs_; }
  int num_outputs() const override { return 1; }
  int num_context() const override { return 1; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    *y = x[0] - context[0];
    if (jacobian != nullptr) {
      std::fill_n(jacobian, num_inputs_, 0.0);
      jacobian[0] = 1.0;
    }
    return std::isfinite(*y);
  }
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* /*x*/,
                       const double* /*context*/,
                       const double* /*w*/,
                       double* hessian) const override {
    std::fill_n(hessian, num_inputs_ * num_inputs_, 0.0);
    return true;
  }

 private:
  int num_inputs_;
};

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_VALUE_RESIDUAL_H_
