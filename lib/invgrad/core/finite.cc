#include "invgrad/core/finite.h"

#include <cmath>
#include <sstream>

namespace invgrad {

bool CheckFinite(const std::string& name,
                 const Eigen::Ref<const Eigen::MatrixXd>& values,
                 std::string* error) {
  for (Eigen::Index j = 0; j < values.cols(); ++j) {
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      if (std::isfinite(values(i, j))) continue;
      std::ostringstream message;
      message << name << " is not finite: entry ";
      if (values.cols() == 1) {
        message << i;
      } else {
        message << "(" << i << ", " << j << ")";
      }
      message << " is " << values(i, j);
      *error = message.str();
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
