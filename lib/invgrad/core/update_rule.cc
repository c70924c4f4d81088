#include "invgrad/core/update_rule.h"

namespace invgrad {

std::vector<MemoryPart> UpdateRule::StepMemory(const JacobianSizes& J) const {
  constexpr double kNumVectors = 6.0;
  std::vector<MemoryPart> parts = {
      {"vectors of weights", kNumVectors * sizeof(double) * J.cols}};
  if (Needs().hessian) {
    // The matrix to be decomposed, and two matrices of workspace for LAPACK.
    parts.push_back({"factorization of the Hessian",
                     3.0 * sizeof(double) * J.cols * J.cols});
  }
  return parts;
}

double UpdateRule::StepWork(const JacobianSizes& J) const {
  return Needs().hessian ? 10.0 * J.cols * J.cols * J.cols : 0.0;
}

}  // namespace invgrad
