#include "invgrad/inverse_simulator.h"

#include <algorithm>

#include "fmt/ranges.h"

namespace invgrad {

std::string NoInverse(const InverseSimulator::ConstVectorRef& y) {
  constexpr Eigen::Index kMaxNumEntries = 3;
  const Eigen::Index shown = std::min(y.size(), kMaxNumEntries);
  return fmt::format("the inverse has no x for y = ({:.4g}{})",
                     fmt::join(y.data(), y.data() + shown, ", "),
                     shown < y.size() ? ", ..." : "");
}

}  // namespace invgrad
