// A simulator with a value and no finite second derivative.
#ifndef TESTS_WITHOUT_HESSIAN_H_
#define TESTS_WITHOUT_HESSIAN_H_

#include "invgrad/chain/simulator.h"

namespace invgrad {

// y = x.
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
