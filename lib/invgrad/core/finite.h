// Finds an entry of a vector or matrix that is not a finite number.
//
// Cost:    one pass.
#ifndef INVGRAD_CORE_FINITE_H_
#define INVGRAD_CORE_FINITE_H_

#include <string>

#include "Eigen/Core"

namespace invgrad {

// True if all entries are finite. Otherwise *error is
// "`name` is not finite: entry (2, 3) is nan"; of a vector, "entry 2".
bool CheckFinite(const std::string& name,
                 const Eigen::Ref<const Eigen::MatrixXd>& values,
                 std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_CORE_FINITE_H_
