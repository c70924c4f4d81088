// What a step of a rule costs, by what the rule needs and the sizes of J: the
// one estimate for all limits on time and memory.
//
//   factorization   k^2 (m + n + 9 k) operations, by Cholesky
//                   k^2 (m + n - k / 2), 16 k^2 bytes, and a dense J if
//                   m > n;   k = min(m, n), or n by J^T J
//   of a sparse J   500 operations and 100 bytes for each entry of J; a factor
//                   with much fill needs more (cholmod_factor.h)
//   Hessian         10 n^3 operations, 32 n^2 bytes
//   what it keeps   8 n^2 bytes for each matrix
//   a product       12 operations for each entry of J, and 25 n; at most 2 k
//                   products
//
// Units:   operations of a large dense product, kOperationsPerSecond on one
//          core; bytes. Doubles, because products of sizes may overflow an int.
//          Accurate to about a factor of two.
#ifndef INVGRAD_CORE_STEP_COST_H_
#define INVGRAD_CORE_STEP_COST_H_

#include <vector>

#include "invgrad/core/memory_limit.h"
#include "invgrad/linearization.h"

namespace invgrad {

inline constexpr double kOperationsPerSecond = 1e10;

// `num_entries`: of a sparse J; 0: it is dense, and products are not counted.
double StepOperations(const LinearizationParts& needs,
                      double rows,
                      double cols,
                      double num_entries);

// Of the matrices that the rule keeps from step to step.
double MatrixBytes(const LinearizationParts& needs, double cols);

// Of each of `num_ranks` that share the rows; the linearization not included.
std::vector<MemoryPart> StepMemory(const LinearizationParts& needs,
                                   double rows,
                                   double cols,
                                   double num_entries,
                                   int num_ranks);

}  // namespace invgrad

#endif  // INVGRAD_CORE_STEP_COST_H_
