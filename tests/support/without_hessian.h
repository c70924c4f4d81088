// Simulators without second derivatives, for tests.
#ifndef TESTS_WITHOUT_HESSIAN_H_
#define TESTS_WITHOUT_HESSIAN_H_

#include "invgrad/simulator.h"

namespace invgrad {

// y = (x, 2 x), with no more than an implementation must have.
class FirstOrderSimulator final : public Simulator {
 public:
  int num_inputs() const override { return 1; }
  int num_outputs() const override { return 2; }
  bool Evaluate(const double* x,
                const double* /*context*/,
                double* y,
                double* jacobian) const override {
    y[0] = x[0];
    y[1] = 2.0 * x[0];
    if (jacobian != nullptr) {
      jacobian[0] = 1.0;
      jacobian[1] = 2.0;
    }
    return true;
  }
};

// y = x, with second derivatives that are never finite.
class WithoutHessian final : public Simulator {
 public:
  int num_inputs() const override { return 2; }
  int num_outputs() const override { return 2; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    return identity_.Evaluate(x, context, y, jacobian);
  }
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* /*x*/,
                       const double* /*context*/,
                       const double* /*w*/,
                       double* /*hessian*/) const override {
    return false;
  }

 private:
  IdentitySimulator identity_{2};
};

}  // namespace invgrad

#endif  // TESTS_WITHOUT_HESSIAN_H_
