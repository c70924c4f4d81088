#include "bin/support/parse_list.h"

#include <algorithm>
#include <limits>
#include <sstream>

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

}  // namespace

bool ParseSeeds(const std::string& text,
                std::vector<int>* seeds,
                std::string* error) {
  seeds->clear();
  for (const std::string& item : Split(text)) {
    int seed = 0;
    const Range range{0.0, std::numeric_limits<int>::max()};
    if (!ParseItem(item, "seed", range, &seed, error)) return false;
    if (std::find(seeds->begin(), seeds->end(), seed) != seeds->end()) {
      *error = "seed " + item + " is given twice";
      return false;
    }
    seeds->push_back(seed);
  }
  if (seeds->empty()) *error = "no seed is given";
  return !seeds->empty();
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
