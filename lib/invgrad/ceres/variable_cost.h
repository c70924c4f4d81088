// The cost of a ceres::Solve without the fixed cost, which is that of the
// residual blocks whose parameter blocks are all constant. Ceres decides by it,
// but reports
//
//   IterationSummary::cost = variable cost + fixed cost,
//
// of which the variable cost is rounding error if the fixed cost is large.
//
// Cost:    if the fixed cost is more than 1,000 times the other, all residual
//          blocks after each accepted step; otherwise nothing.
#ifndef INVGRAD_CERES_VARIABLE_COST_H_
#define INVGRAD_CERES_VARIABLE_COST_H_

#include <string>

#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "invgrad/ceres/problem_linearizer.h"

namespace invgrad {

// The fixed cost at the current values; the structure is that of the problem.
// Returns false, with *error, if one of the residual blocks has none.
bool FixedCost(const ceres::Problem& problem,
               const ProblemStructure& structure,
               double* cost,
               std::string* error);

class VariableCost {
 public:
  // The linearizer leaves out the fixed residual blocks of the problem. Keeps
  // the pointer to it.
  VariableCost(const ceres::Problem& problem,
               const ProblemLinearizer* linearizer);

  // Call after each iteration, in order, the 0th included, while the blocks
  // hold the solver's state. Returns iteration.cost without the fixed cost.
  double Of(const ceres::IterationSummary& iteration);

 private:
  double Compute(const ceres::IterationSummary& iteration) const;

  const ProblemLinearizer& linearizer_;
  double fixed_cost_ = 0.0;
  double cost_ = 0.0;  // at the last accepted state
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_VARIABLE_COST_H_
