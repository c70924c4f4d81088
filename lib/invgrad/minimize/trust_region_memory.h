// The memory of a trust region of Ceres with a Jacobian of a given size: the
// copies of J in the linear solver, 8 m n bytes each, and the normal equations,
// 8 n^2.
#ifndef INVGRAD_MINIMIZE_TRUST_REGION_MEMORY_H_
#define INVGRAD_MINIMIZE_TRUST_REGION_MEMORY_H_

#include <vector>

#include "ceres/types.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {

std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          double rows,
                                          double cols);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_TRUST_REGION_MEMORY_H_
