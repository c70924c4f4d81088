// The square root of an information matrix, the inverse of a covariance.
//
//   W^T W = information, so that |W e|^2 = e^T information e
//
// W is the upper Cholesky factor. If the information is semidefinite, because
// a measurement says nothing about some directions, W is another root, with
// rows of zeros. Rows and columns may have different units.
//
// Fails:   returns false if the matrix is not symmetric positive semidefinite.
//          In units in which its diagonal is one, eigenvalues that are negative
//          by the rounding of a matrix of six digits count as zero.
#ifndef PROBLEMS_ESTIMATION_INFORMATION_H_
#define PROBLEMS_ESTIMATION_INFORMATION_H_

#include "Eigen/Core"

namespace invgrad {

bool UpperRoot(const Eigen::MatrixXd& information, Eigen::MatrixXd* root);

// Whether the information has an inverse.
bool IsDefinite(const Eigen::MatrixXd& information);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_INFORMATION_H_
