#include "invgrad/core/specification.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <system_error>

#include "fmt/core.h"
#include "fmt/ranges.h"

namespace invgrad {
namespace {

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

// The candidates nearest to `name`, nearest first, at most three; those too far
// to be a misspelling are left out.
std::vector<std::string> NearestNames(
    const std::string& name, const std::vector<std::string>& candidates) {
  // One edit, and one more for every four characters: two edits cover swapped
  // neighbours ("adma"), four a changed ending.
  const int limit = 1 + static_cast<int>(name.size() / 4);
  std::multimap<int, std::string> by_distance;
  for (const std::string& candidate : candidates) {
    by_distance.emplace(EditDistance(name, candidate), candidate);
  }
  std::vector<std::string> names;
  for (const auto& [distance, candidate] : by_distance) {
    if (distance > limit || names.size() == 3) break;
    names.push_back(candidate);
  }
  return names;
}

}  // namespace

std::string_view Trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n\v\f";
  const size_t begin = std::min(text.find_first_not_of(kSpace), text.size());
  return text.substr(begin, text.find_last_not_of(kSpace) + 1 - begin);
}

std::vector<std::string> TrimmedPieces(std::string_view text, char separator) {
  std::vector<std::string> pieces;
  while (true) {
    const size_t end = text.find(separator);
    pieces.emplace_back(Trimmed(text.substr(0, end)));
    if (end == std::string_view::npos) return pieces;
    text.remove_prefix(end + 1);
  }
}

bool ParseFinite(std::string_view text, double* value) {
  // std::from_chars rejects a plus sign.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') {
    text.remove_prefix(1);
  }
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end && std::isfinite(*value);
}

bool ParseSpecifications(const std::string& text,
                         std::vector<Specification>* specifications,
                         std::string* error) {
  std::vector<Specification> result;
  for (const std::string& part : TrimmedPieces(text, ',')) {
    const std::vector<std::string> pieces = TrimmedPieces(part, ':');
    Specification specification;
    specification.text = part;
    specification.name = pieces[0];
    if (specification.name.empty() ||
        specification.name.find('=') != std::string::npos) {
      *error = fmt::format(
          "'{}' (number {} of '{}') does not start with a name; expected "
          "name:key=value:key=value",
          Printable(part),
          result.size() + 1,
          Printable(text));
      return false;
    }
    for (size_t i = 1; i < pieces.size(); ++i) {
      const size_t equals = pieces[i].find('=');
      if (equals == std::string::npos || equals == 0) {
        *error = fmt::format(
            "'{}' in '{}' has no {}; expected name:key=value:key=value",
            Printable(pieces[i]),
            Printable(part),
            equals == 0 ? "key" : "'='");
        return false;
      }
      specification.settings.emplace_back(
          Trimmed(std::string_view(pieces[i]).substr(0, equals)),
          Trimmed(std::string_view(pieces[i]).substr(equals + 1)));
    }
    result.push_back(std::move(specification));
  }
  *specifications = std::move(result);
  return true;
}

std::string UnknownNameMessage(const std::string& what,
                               const std::string& name,
                               const std::vector<std::string>& candidates) {
  std::vector<std::string> names = NearestNames(name, candidates);
  if (names.empty()) {
    return fmt::format("unknown {} '{}'; known: {}",
                       what,
                       Printable(name),
                       fmt::join(candidates, ", "));
  }
  std::string last = names.back();
  names.pop_back();
  if (!names.empty()) {
    last = fmt::format("{} or {}", fmt::join(names, ", "), last);
  }
  return fmt::format(
      "unknown {} '{}'; did you mean {}?", what, Printable(name), last);
}

std::string Printable(std::string_view text, std::size_t max_size) {
  std::string shown;
  for (const char c : text.substr(0, max_size)) {
    const bool is_printable = c >= ' ' && c <= '~';
    shown += is_printable
                 ? std::string(1, c)
                 : fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  }
  return shown + (text.size() > max_size ? "..." : "");
}

}  // namespace invgrad
