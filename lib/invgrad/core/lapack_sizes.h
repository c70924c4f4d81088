// Sizes of matrices as LAPACK takes them.
#ifndef INVGRAD_CORE_LAPACK_SIZES_H_
#define INVGRAD_CORE_LAPACK_SIZES_H_

#include <lapacke.h>

#include <algorithm>

#include "Eigen/Core"

namespace invgrad {

inline lapack_int LapackSize(Eigen::Index size) {
  return static_cast<lapack_int>(size);
}

// At least one, also for an empty matrix.
inline lapack_int LeadingDimension(const Eigen::MatrixXd& A) {
  return LapackSize(std::max<Eigen::Index>(A.rows(), 1));
}

}  // namespace invgrad

#endif  // INVGRAD_CORE_LAPACK_SIZES_H_
