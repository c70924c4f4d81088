#include "invgrad/io/format.h"

#include <cmath>

#include "fmt/core.h"

namespace invgrad {

std::string FormatNumber(double value, int digits) {
  return std::isnan(value) ? "nan" : fmt::format("{:.{}g}", value, digits);
}

}  // namespace invgrad
