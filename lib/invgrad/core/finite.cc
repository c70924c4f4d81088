#include "invgrad/core/finite.h"

#include <cmath>

#include "fmt/core.h"

namespace invgrad {

bool CheckFinite(const std::string& name,
                 const Eigen::Ref<const Eigen::MatrixXd>& values,
                 std::string* error) {
  for (Eigen::Index j = 0; j < values.cols(); ++j) {
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      if (std::isfinite(values(i, j))) continue;
      const std::string entry = values.cols() == 1
                                    ? fmt::format("{}", i)
                                    : fmt::format("({}, {})", i, j);
      *error = fmt::format(
          "{} is not finite: entry {} is {}", name, entry, values(i, j));
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
