#include "bin/support/parse_list.h"

#include <algorithm>
#include <limits>
#include <sstream>

#include "fmt/core.h"
#include "invgrad/core/option_set.h"

namespace invgrad {
namespace {

std::vector<std::string> Split(const std::string& text) {
  std::vector<std::string> items;
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) {
    items.push_back(item);
  }
  return items;
}

// An OptionSet has the number's syntax, range and messages.
template <typename Number>
bool ParseItem(const std::string& text,
               const char* name,
               const Range& range,
               Number* number,
               std::string* error) {
  OptionSet set;
  set.Add(name, number, range, "");
  return set.Set(name, text, error);
}

bool ParseSeed(const std::string& text, long* seed, std::string* error) {
  int number = 0;
  const Range range{0.0, std::numeric_limits<int>::max()};
  if (!ParseItem(text, "seed", range, &number, error)) return false;
  *seed = number;
  return true;
}

// Adds the seeds after the last one up to `end`, in steps of `step`.
bool AddRange(long step,
              long end,
              const std::string& text,
              std::vector<int>* seeds,
              std::string* error) {
  constexpr long kMaxNumSeeds = 10000;
  const long length = end - seeds->back();
  if (step <= 0 || length <= 0 || length % step != 0 ||
      length / step >= kMaxNumSeeds) {
    *error = fmt::format(
        "{} is no list; expected 1..20 or 1,2,...,20: ascending to the last "
        "one, at most {} seeds",
        text,
        kMaxNumSeeds);
    return false;
  }
  while (seeds->back() != end) {
    seeds->push_back(static_cast<int>(seeds->back() + step));
  }
  return true;
}

}  // namespace

bool ParseSeeds(const std::string& text,
                std::vector<int>* seeds,
                std::string* error) {
  seeds->clear();
  const std::vector<std::string> items = Split(text);
  for (size_t i = 0; i < items.size(); ++i) {
    long seed = 0, end = 0;
    const size_t dots = items[i].find("..");
    if (items[i] == "..." && i > 0 && i + 1 < items.size()) {
      const size_t size = seeds->size();
      const long step = size > 1 ? long{seeds->back()} - (*seeds)[size - 2] : 1;
      if (!ParseSeed(items[++i], &end, error) ||
          !AddRange(step, end, text, seeds, error)) {
        return false;
      }
    } else if (dots != std::string::npos) {
      if (!ParseSeed(items[i].substr(0, dots), &seed, error) ||
          !ParseSeed(items[i].substr(dots + 2), &end, error)) {
        return false;
      }
      seeds->push_back(static_cast<int>(seed));
      if (!AddRange(1, end, text, seeds, error)) return false;
    } else {
      if (!ParseSeed(items[i], &seed, error)) return false;
      seeds->push_back(static_cast<int>(seed));
    }
  }
  std::vector<int> sorted = *seeds;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) {
    *error = fmt::format("seed {} is given twice", *twice);
  } else if (seeds->empty()) {
    *error = "no seed is given";
  }
  return twice == sorted.end() && !seeds->empty();
}

bool ParseNumbers(const std::string& text,
                  std::vector<double>* numbers,
                  std::string* error) {
  numbers->clear();
  for (const std::string& item : Split(text)) {
    double number = 1.0;
    const Range range{0.0, std::numeric_limits<double>::infinity(), true};
    if (!ParseItem(item, "number", range, &number, error)) return false;
    numbers->push_back(number);
  }
  return true;
}

}  // namespace invgrad
