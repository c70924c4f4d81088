#include "invgrad/io/format.h"

#include <charconv>
#include <cmath>

#include "glog/logging.h"

namespace invgrad {
namespace {

// "3 min 05 s": the second part always has two digits.
std::string TwoParts(long large,
                     const char* large_unit,
                     long small,
                     const char* small_unit) {
  return std::to_string(large) + large_unit + (small < 10 ? " 0" : " ") +
         std::to_string(small) + small_unit;
}

std::string Fixed(double value, int decimals) {
  char buffer[340];  // the largest double has 309 digits
  const auto result = std::to_chars(buffer,
                                    buffer + sizeof(buffer),
                                    value,
                                    std::chars_format::fixed,
                                    decimals);
  return std::string(buffer, result.ptr);
}

}  // namespace

std::string FormatDuration(double seconds) {
  constexpr double kLongest = 1e12;
  if (!(seconds >= 0.0 && seconds < kLongest)) {
    return "?";
  }
  // The bounds are where the shorter form would round up to the next one.
  if (seconds < 0.9995) {
    return Fixed(seconds, 3) + " s";
  }
  if (seconds < 59.95) {
    return Fixed(seconds, 1) + " s";
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
  char buffer[40];
  const auto result = std::to_chars(buffer,
                                    buffer + sizeof(buffer),
                                    value,
                                    std::chars_format::general,
                                    digits);
  const std::string text(buffer, result.ptr);
  return std::isnan(value) ? "nan" : text;
}

}  // namespace invgrad
