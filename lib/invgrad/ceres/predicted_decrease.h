// Whether a problem is at a minimum, by its linear model
// (internal/model_decrease.h): Ceres' tolerances can be met far from one, that
// for the gradient, which has a unit, by small residuals alone.
#ifndef INVGRAD_CERES_PREDICTED_DECREASE_H_
#define INVGRAD_CERES_PREDICTED_DECREASE_H_

#include "invgrad/ceres/problem_linearizer.h"

namespace invgrad {

// The share of the cost that the model takes away at the current values. 0, too,
// below what the tolerances allow, where it would cost too much (more than 50
// parameters, or 4e7 entries of J), where there are no degrees of freedom, and
// where a bound may hold the state.
double PredictedDecrease(double function_tolerance,
                         double parameter_tolerance,
                         bool has_bounds,
                         const ProblemLinearizer& linearizer);

}  // namespace invgrad

#endif  // INVGRAD_CERES_PREDICTED_DECREASE_H_
