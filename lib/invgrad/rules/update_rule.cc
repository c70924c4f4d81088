#include "invgrad/rules/update_rule.h"

#include "glog/logging.h"

namespace invgrad {

void InitializeOnce(Eigen::Index size, double value, Eigen::VectorXd* array) {
  if (array->size() == 0) array->setConstant(size, value);
  CHECK_EQ(array->size(), size)
      << "An update rule belongs to one run, but the number of unknowns has "
         "changed.";
}

}  // namespace invgrad
