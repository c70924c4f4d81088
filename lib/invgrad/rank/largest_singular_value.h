// The largest singular value of J by the Lanczos iteration on J^T J.
//
//   s_max^2 = the largest Ritz value of T_k,   V^T J^T J V = T_k tridiagonal
//
// Without reorthogonalization: the largest Ritz value does not need it [1].
//
// Accuracy: a lower bound, to about `tolerance`: the iteration stops when eight
//          steps change the value by less, or after 100 steps.
// Cost:    a product with J and one with J^T a step; 10 to 40 steps.
// Fails:   NaN if a product with J is not finite; 0 for J = 0.
//
// [1] Paige. Accuracy and effectiveness of the Lanczos algorithm for the
//     symmetric eigenproblem. Linear Algebra Appl. 34 (1980).
#ifndef INVGRAD_RANK_LARGEST_SINGULAR_VALUE_H_
#define INVGRAD_RANK_LARGEST_SINGULAR_VALUE_H_

#include "invgrad/core/jacobian_operator.h"

namespace invgrad {

double LargestSingularValue(const JacobianOperator& J, double tolerance);

}  // namespace invgrad

#endif  // INVGRAD_RANK_LARGEST_SINGULAR_VALUE_H_
