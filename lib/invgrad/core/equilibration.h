// Units in which the rows of a symmetric matrix are alike.
//
// Cost:    12 passes over H.
//
// Source:  Ruiz. A scaling algorithm to equilibrate both rows and columns norms
//          in matrices. RAL-TR-2001-034, 2001. Each pass halves the remaining
//          exponents; 12 passes bring 1e300 to within a factor of two.
#ifndef INVGRAD_CORE_EQUILIBRATION_H_
#define INVGRAD_CORE_EQUILIBRATION_H_

#include "Eigen/Core"

namespace invgrad {

// Powers of two d such that every row and column of diag(d) H diag(d) has a
// largest entry near one: a well-posed H in different units would look singular
// otherwise. Zero rows keep d = 1.
Eigen::VectorXd EquilibrationOf(const Eigen::MatrixXd& H);

}  // namespace invgrad

#endif  // INVGRAD_CORE_EQUILIBRATION_H_
