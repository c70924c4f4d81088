// The product of the Hessian and a vector, by central differences of the
// gradient: for every objective, without second derivatives.
//
//   H v ~ (gradient(x + h v) - gradient(x - h v)) / (2 h)
//   h = eps^(1/3) max(1, |x| / sqrt(n)) / |v|_inf,   eps = 2^-52
//
// The error is h^2 / 6 |d3L/dx3[v, v]| + eps |gradient| / h. If the gradient
// changes over lengths of about max(1, |x| / sqrt(n)), both terms are smallest
// together at this h, and about eps^(2/3) = 4e-11 of the gradient. h is a power
// of two, so that x +- h v has the least rounding error. A gradient in single
// precision has an error of 1e-7 / h, a few percent, in H v.
//
// Shapes:  x, v, H v, gradient: n. For a manifold, gradients are those of the
//          tangent spaces at the two points, and H v has the additional term of
//          the turning of these spaces, which vanishes with the gradient.
// Units:   as the unknowns: unknowns far below one need a scale of their own.
// Cost:    two gradients.
// Fails:   returns false, with *error, if a gradient cannot be computed or is
//          not finite.
//
// Source:  Nocedal, Wright. Numerical Optimization. Springer 2006, section 8.1.
#ifndef INVGRAD_CORE_HESSIAN_TIMES_H_
#define INVGRAD_CORE_HESSIAN_TIMES_H_

#include "Eigen/Core"
#include "invgrad/linearization.h"

namespace invgrad {

// Sets linearization->hessian_times at x, unless the objective has set it itself,
// and linearization->after, each if `parts` has it.
void AddProductsAndTrials(const LinearizationParts& parts,
                          const Eigen::VectorXd& x,
                          LinearizeAfter after,
                          Linearization* linearization);

}  // namespace invgrad

#endif  // INVGRAD_CORE_HESSIAN_TIMES_H_
