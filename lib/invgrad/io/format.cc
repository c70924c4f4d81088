#include "invgrad/io/format.h"

#include <cmath>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

// "3 min 05 s": the second part always has two digits.
std::string TwoParts(long large,
                     const char* large_unit,
                     long small,
                     const char* small_unit) {
  return fmt::format("{}{} {:02}{}", large, large_unit, small, small_unit);
}

}  // namespace

std::string FormatDuration(double seconds) {
  constexpr double kLongest = 1e12;
  if (!(seconds >= 0.0 && seconds < kLongest)) {
    return "?";
  }
  // At these bounds the shorter form would round up to the next unit.
  if (seconds < 0.9995) {
    return fmt::format("{:.3f} s", seconds);
  }
  if (seconds < 59.95) {
    return fmt::format("{:.1f} s", seconds);
  }
  const long whole = std::lround(seconds);
  if (whole < 3600) {
    return TwoParts(whole / 60, " min", whole % 60, " s");
  }
  const long minutes = std::lround(seconds / 60.0);
  if (minutes < 24L * 60L) {
    return TwoParts(minutes / 60, " h", minutes % 60, " min");
  }
  const long hours = std::lround(seconds / 3600.0);
  return TwoParts(hours / 24, " d", hours % 24, " h");
}

std::string FormatNumber(double value, int digits) {
  CHECK_GT(digits, 0);
  CHECK_LE(digits, 17);
  return std::isnan(value) ? "nan" : fmt::format("{:.{}g}", value, digits);
}

}  // namespace invgrad
