// A simulator of fields, whose Jacobian is applied and never formed.
//
//   y = P(x; c),   J v,   J^T w
//
// An implementation defines the sizes, Value, and Linearize, whose result
// computes both products (FunctionJacobian, jacobian_operator.h). It may keep
// what the forward run has computed, so that a product does not repeat it.
//
// Shapes:  x: num_inputs;  y: num_outputs;  J: num_outputs x num_inputs.
// Cost:    Adjoint: one Linearize and one J^T w. Evaluate with a Jacobian:
//          min(|x|, |y|) products and |x| |y| numbers; for tests and small
//          grids only.
// Fails:   as simulator.h.
// Test:    w . (J v) = v . (J^T w), to rounding, for random v and w.
#ifndef INVGRAD_FIELD_SIMULATOR_H_
#define INVGRAD_FIELD_SIMULATOR_H_

#include <memory>

#include "invgrad/simulator.h"

namespace invgrad {

class FieldSimulator : public Simulator {
 public:
  // Computes y.
  virtual bool Value(const double* x,
                     const double* context,
                     double* y) const = 0;

  std::unique_ptr<const JacobianOperator> Linearize(
      const double* x, const double* context, double* y) const override = 0;

  bool forms_jacobian() const final { return false; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const final;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
};

}  // namespace invgrad

#endif  // INVGRAD_FIELD_SIMULATOR_H_
