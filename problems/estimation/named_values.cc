#include "problems/estimation/named_values.h"

#include <algorithm>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>

#include "fmt/ranges.h"
#include "invgrad/core/specification.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

std::string WithoutSpaces(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), ' '), text.end());
  return text;
}

// "b1=1,b2=0.5" -> {0: "1", 1: "0.5"}, by the names' indices.
bool ParseItems(const std::string& flag,
                const std::string& text,
                const std::vector<std::string>& names,
                std::map<int, std::string>* items,
                std::string* error) {
  std::istringstream list(WithoutSpaces(text));
  for (std::string item; std::getline(list, item, ',');) {
    const std::size_t equals = item.find('=');
    const std::string name = item.substr(0, equals);
    const auto found = std::find(names.begin(), names.end(), name);
    const auto index = static_cast<int>(found - names.begin());
    if (equals == std::string::npos) {
      *error = fmt::format(
          "--{}: found '{}'; expected NAME=...", flag, Printable(item, 40));
    } else if (found == names.end()) {
      *error = fmt::format("--{}: the model has no parameter '{}'; it has {}",
                           flag,
                           Printable(name, 40),
                           fmt::join(names, ", "));
    } else if (!items->emplace(index, item.substr(equals + 1)).second) {
      *error = fmt::format("--{}: {} is there twice", flag, name);
    } else {
      continue;
    }
    return false;
  }
  return true;
}

// Of "", `missing`.
bool ParseBound(std::string_view text, double missing, double* bound) {
  *bound = missing;
  return text.empty() || ParseFinite(text, bound);
}

}  // namespace

bool ReadStartValues(const std::string& text,
                     const std::vector<std::string>& names,
                     const std::string& columns,
                     double* values,
                     std::string* error) {
  std::map<int, std::string> items;
  if (!ParseItems("start_values", text, names, &items, error)) return false;
  std::vector<std::string> missing;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto item = items.find(static_cast<int>(i));
    if (item == items.end()) {
      missing.push_back(names[i]);
    } else if (!ParseFinite(item->second, &values[i])) {
      *error = fmt::format("--start_values: {}={}; expected a finite number",
                           names[i],
                           Printable(item->second, 40));
      return false;
    }
  }
  if (missing.empty()) return true;
  *error = fmt::format(
      "--start_values: no start value for {}; expected "
      "--start_values={}=NUMBER,... for each parameter of the model (the "
      "columns "
      "are {})",
      fmt::join(missing, ", "),
      missing[0],
      columns);
  return false;
}

bool ReadBounds(const std::string& text,
                const std::vector<std::string>& names,
                const Eigen::MatrixXd& starts,
                Eigen::VectorXd* lower,
                Eigen::VectorXd* upper,
                std::string* error) {
  std::map<int, std::string> items;
  if (!ParseItems("bounds", text, names, &items, error)) return false;
  // Ceres' unbounded.
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  const auto n = static_cast<Eigen::Index>(names.size());
  lower->setConstant(n, -kUnbounded);
  upper->setConstant(n, kUnbounded);
  for (const auto& [index, item] : items) {
    const std::size_t dots = item.find("..");
    double& low = (*lower)[index];
    double& high = (*upper)[index];
    if (dots == std::string::npos ||
        !ParseBound(std::string_view(item).substr(0, dots), low, &low) ||
        !ParseBound(std::string_view(item).substr(dots + 2), high, &high) ||
        low >= high) {
      *error = fmt::format(
          "--bounds: {}={}; expected LOW..HIGH, LOW.. or ..HIGH with LOW < "
          "HIGH",
          names[index],
          Printable(item, 40));
      return false;
    }
    for (const double start : starts.row(index)) {
      if (start >= low && start <= high) continue;
      *error = fmt::format("--bounds: {}={}; the start value {} is outside",
                           names[index],
                           item,
                           start);
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
