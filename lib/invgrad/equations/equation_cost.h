// The terms of a differential equation as a cost function of Ceres: what
// AddEquationToProblem (equation.h) adds.
//
//   r = y(theta, p) / sqrt(N),   1/2 |r|^2 = L(theta, p)        (equation.h)
//
// The network's weights theta are the blocks of Network::WeightBlocks (the
// neurons); each coefficient p_i is a block of its own, which can have bounds,
// a manifold, be constant, or be shared with other residual blocks.
//
// Cost:    J is formed: N |y| (n + |p|) numbers.
// Fails:   Evaluate returns false where the model does.
#ifndef INVGRAD_EQUATIONS_EQUATION_COST_H_
#define INVGRAD_EQUATIONS_EQUATION_COST_H_

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "invgrad/data.h"
#include "invgrad/equation.h"
#include "invgrad/equations/equation_simulator.h"
#include "invgrad/model.h"

namespace invgrad {

class EquationCostFunction final : public ceres::CostFunction {
 public:
  // samples: those of EquationSamples.
  EquationCostFunction(const Equation& equation, DataSet samples);
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override;

 private:
  Model model_;
  DataSet samples_;  // with any coefficients
  EquationContext layout_;
};

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_EQUATION_COST_H_
