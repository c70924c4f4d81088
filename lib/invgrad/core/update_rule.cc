#include "invgrad/core/update_rule.h"

#include "glog/logging.h"

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

void InitializeOnce(Eigen::Index size, double value, Eigen::VectorXd* array) {
  if (array->size() == 0) array->setConstant(size, value);
  CHECK_EQ(array->size(), size)
      << "The number of unknowns has changed; use a new update rule for each "
         "run.";
}

}  // namespace invgrad
