// Checks that residuals are affine in the parameters that are named linear, at
// the current values of the others.
//
//   r(c_2) = r(c_1) + Phi (c_2 - c_1),   Phi(c_1) = Phi(c_2)
//
// c_1 and c_2 are random, c_j + u max(|c_j|, 1) with u uniform in (-1, 1) and a
// fixed seed. Differences are relative to the terms of their row, |r| + sum_j
// |Phi_ij| max(|c_j|, 1). Rounding makes them 1e-15, and 1e-10 where Phi comes
// from numeric differences (steps of 1e-6), which are exact for affine
// functions; what curves by less than kAffineTolerance at the size of the
// parameters is taken to be affine.
//
// Cost:    two evaluations with Jacobians.
// Fails:   returns false, with a message that names the residual block, the
//          parameter and the relative difference.
#ifndef INVGRAD_SEPARABLE_AFFINE_CHECK_H_
#define INVGRAD_SEPARABLE_AFFINE_CHECK_H_

#include <functional>
#include <string>

#include "invgrad/separable/component_residuals.h"

namespace invgrad {

constexpr double kAffineTolerance = 1e-8;

// `name`: of a linear parameter, as "`b`[1]".
bool CheckAffine(
    const ComponentResiduals& residuals,
    const std::function<std::string(const ComponentResiduals::Parameter&)>&
        name,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_SEPARABLE_AFFINE_CHECK_H_
