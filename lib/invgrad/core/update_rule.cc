#include "invgrad/core/update_rule.h"

#include "glog/logging.h"

namespace invgrad {

std::vector<MemoryPart> UpdateRule::StepMemory(const JacobianSizes& J) const {
  constexpr int kNumVectors = 6;
  return {{"vectors of weights", kNumVectors * sizeof(double) * J.cols}};
}

void InitializeOnce(Eigen::Index size, double value, Eigen::VectorXd* array) {
  if (array->size() == 0) array->setConstant(size, value);
  CHECK_EQ(array->size(), size)
      << "An update rule belongs to one run, but the number of unknowns has "
         "changed.";
}

}  // namespace invgrad
