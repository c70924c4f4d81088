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

#include <functional>
#include <string>

#include "Eigen/Core"
#include "invgrad/core/linearization.h"
#include "invgrad/core/objective.h"

namespace invgrad {

// The gradient at x + step.
using GradientAfter = std::function<bool(const Eigen::VectorXd& step,
                                         Eigen::VectorXd* gradient,
                                         std::string* error)>;

// Sets linearization->hessian_times at x.
void AddHessianTimes(const Eigen::VectorXd& x,
                     GradientAfter gradient_after,
                     Linearization* linearization);

// The same for an objective at its current state, unless the objective has set
// the function itself. The function moves the objective and moves it back; it
// does not own the objective.
void AddHessianTimes(Objective* objective, Linearization* linearization);

}  // namespace invgrad

#endif  // INVGRAD_CORE_HESSIAN_TIMES_H_
