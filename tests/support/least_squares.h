// min_X |A X - B|, of all minima that of least norm. Eigen's decomposition takes
// seconds to compile: it is compiled once, here.
#ifndef INVGRAD_TESTS_SUPPORT_LEAST_SQUARES_H_
#define INVGRAD_TESTS_SUPPORT_LEAST_SQUARES_H_

#include "Eigen/Core"

namespace invgrad {

Eigen::MatrixXd LeastSquares(const Eigen::MatrixXd& A,
                             const Eigen::MatrixXd& B);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_LEAST_SQUARES_H_
