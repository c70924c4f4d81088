// The coefficients of a vector in the eigenvectors of a symmetric tridiagonal
// matrix, without the eigenvectors.
//
//   T = W diag(lambda) W^T,   c = W^T h
//
// The implicit QL iteration of LAPACK's dsteqr; each of its rotations is applied
// to the two entries of one vector instead of the rows of a matrix. Golub and
// Welsch compute the weights of Gauss quadratures in this way [1].
//
// Shapes:  diagonal, h, lambda, c: m;  off_diagonal: m - 1.
// Units:   the squares of T's entries must neither over- nor underflow.
// Cost:    about m^2 rotations.
// Accuracy: lambda to a few epsilon |T|; c as for a T with such an error.
// Fails:   returns false if an eigenvalue does not converge in 50 iterations, as
//          with NaN.
//
// [1] Golub, Welsch. Calculation of Gauss quadrature rules. Mathematics of
//     Computation 23 (1969), 221-230, section 4.
#ifndef INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_COEFFICIENTS_H_
#define INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_COEFFICIENTS_H_

#include "Eigen/Core"

namespace invgrad {

// *lambda: T's diagonal on entry, its eigenvalues on return, not sorted. *c: h on
// entry.
bool TridiagonalCoefficients(Eigen::VectorXd off_diagonal,
                             Eigen::VectorXd* lambda,
                             Eigen::VectorXd* c);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_TRIDIAGONAL_COEFFICIENTS_H_
