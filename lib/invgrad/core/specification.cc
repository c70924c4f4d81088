#include "invgrad/core/specification.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "fmt/core.h"
#include "fmt/format.h"

namespace invgrad {
namespace {

std::string Trimmed(const std::string& text) {
  constexpr char kSpace[] = " \t\r\n";
  const size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

// The trimmed pieces between the separators; one empty piece for "".
std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  size_t begin = 0;
  while (true) {
    const size_t end = text.find(separator, begin);
    pieces.push_back(Trimmed(text.substr(begin, end - begin)));
    if (end == std::string::npos) return pieces;
    begin = end + 1;
  }
}

// Levenshtein's distance: the insertions, deletions and replacements of single
// characters that turn a into b.
int EditDistance(const std::string& a, const std::string& b) {
  // row[j] is the distance from the first i characters of a to the first j
  // characters of b.
  std::vector<int> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const int replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

// "a", "a or b", "a, b or c".
std::string Alternatives(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " or " : ", ";
    text += names[i];
  }
  return text;
}

}  // namespace

bool ParseSpecifications(const std::string& text,
                         std::vector<Specification>* specifications,
                         std::string* error) {
  std::vector<Specification> result;
  for (const std::string& part : Split(text, ',')) {
    const std::vector<std::string> pieces = Split(part, ':');
    Specification specification;
    specification.text = part;
    specification.name = pieces[0];
    if (specification.name.empty() ||
        specification.name.find('=') != std::string::npos) {
      *error = fmt::format(
          "'{}' (number {} of '{}') does not start with a name; expected "
          "name:key=value:key=value",
          part,
          result.size() + 1,
          text);
      return false;
    }
    for (size_t i = 1; i < pieces.size(); ++i) {
      const size_t equals = pieces[i].find('=');
      if (equals == std::string::npos || equals == 0) {
        *error = fmt::format(
            "'{}' in '{}' has no {}; expected name:key=value:key=value",
            pieces[i],
            part,
            equals == 0 ? "key" : "'='");
        return false;
      }
      specification.settings.emplace_back(
          Trimmed(pieces[i].substr(0, equals)),
          Trimmed(pieces[i].substr(equals + 1)));
    }
    result.push_back(std::move(specification));
  }
  *specifications = std::move(result);
  return true;
}

std::vector<std::string> NearestNames(
    const std::string& name, const std::vector<std::string>& candidates) {
  // One edit, and one more for every four characters: two edits cover swapped
  // neighbours ("adma"), four a changed ending.
  const int limit = 1 + static_cast<int>(name.size() / 4);
  std::vector<std::pair<int, std::string>> near;
  for (const std::string& candidate : candidates) {
    const int distance = EditDistance(name, candidate);
    if (distance <= limit) near.emplace_back(distance, candidate);
  }
  std::stable_sort(near.begin(), near.end(), [](const auto& a, const auto& b) {
    return a.first < b.first;
  });
  constexpr size_t kMaxNumNames = 3;
  if (near.size() > kMaxNumNames) near.resize(kMaxNumNames);
  std::vector<std::string> names;
  names.reserve(near.size());
  for (const auto& [distance, candidate] : near) names.push_back(candidate);
  return names;
}

std::string UnknownNameMessage(const std::string& what,
                               const std::string& name,
                               const std::vector<std::string>& candidates) {
  const std::vector<std::string> names = NearestNames(name, candidates);
  if (!names.empty()) {
    return fmt::format(
        "unknown {} '{}'; did you mean {}?", what, name, Alternatives(names));
  }
  return fmt::format(
      "unknown {} '{}'; known: {}", what, name, fmt::join(candidates, ", "));
}

}  // namespace invgrad
