#include "invgrad/core/option_set.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <sstream>

#include "glog/logging.h"

namespace invgrad {
namespace {

constexpr char kAuto[] = "auto";

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

// The shortest text that reads back as the same number: "0.1", "1e-06".
std::string NumberText(double value) {
  char buffer[32];
  const std::to_chars_result result =
      std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, result.ptr);
}

std::string RangeText(const Range& range) {
  const bool open_low = range.open_low || std::isinf(range.low);
  const bool open_high = range.open_high || std::isinf(range.high);
  return (open_low ? "(" : "[") + NumberText(range.low) + ", " +
         NumberText(range.high) + (open_high ? ")" : "]");
}

bool Contains(const Range& range, double value) {
  return std::isfinite(value) &&
         (range.open_low ? value > range.low : value >= range.low) &&
         (range.open_high ? value < range.high : value <= range.high);
}

// std::from_chars, because it takes no spaces and knows no locale. Number is
// double or int.
template <typename Number>
bool ParseNumber(const std::string& text, Number* value) {
  const char* const end = text.data() + text.size();
  const std::from_chars_result result =
      std::from_chars(text.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

template <typename Number>
const char* SetNumber(const std::string& text,
                      const Range& range,
                      const char* not_a_number,
                      Number* field) {
  Number value = 0;
  if (!ParseNumber(text, &value)) return not_a_number;
  if (!std::isfinite(static_cast<double>(value))) return not_a_number;
  if (!Contains(range, value)) return "is out of range";
  *field = value;
  return nullptr;
}

constexpr char kNotANumber[] = "is not a finite number";

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
      std::ostringstream message;
      message << "'" << part << "' (number " << result.size() + 1 << " of '"
              << text << "') does not start with a name; expected "
              << "name:key=value:key=value";
      *error = message.str();
      return false;
    }
    for (size_t i = 1; i < pieces.size(); ++i) {
      const size_t equals = pieces[i].find('=');
      if (equals == std::string::npos || equals == 0) {
        *error = "'" + pieces[i] + "' in '" + part + "' " +
                 (equals == 0 ? "has no key" : "has no '='") +
                 "; expected name:key=value:key=value";
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
  // One slip, and one more for every four characters: two cover a swap of
  // neighbours in "adma", four a word with a changed ending.
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
  std::string message = "unknown " + what + " '" + name + "'";
  const std::vector<std::string> names = NearestNames(name, candidates);
  if (!names.empty()) message += "; did you mean " + Alternatives(names) + "?";
  return message + " (--list shows all)";
}

void OptionSet::AddRow(Row row, Setter setter) {
  for (const Row& other : rows_) {
    CHECK_NE(other.name, row.name) << "An option was added twice.";
  }
  const char* complaint = setter(row.default_value);
  CHECK(complaint == nullptr)
      << "The default " << row.name << "=" << row.default_value << " "
      << complaint << "; allowed: " << row.allowed;
  rows_.push_back(std::move(row));
  setters_.push_back(std::move(setter));
}

void OptionSet::Add(const std::string& name,
                    double* field,
                    const Range& range,
                    const std::string& help) {
  AddRow({name, NumberText(*field), RangeText(range), help},
         [field, range](const std::string& value) {
           return SetNumber(value, range, kNotANumber, field);
         });
}

void OptionSet::Add(const std::string& name,
                    int* field,
                    const Range& range,
                    const std::string& help) {
  AddRow({name, std::to_string(*field), "integer in " + RangeText(range), help},
         [field, range](const std::string& value) {
           return SetNumber(value, range, "is not an integer", field);
         });
}

void OptionSet::Add(const std::string& name,
                    bool* field,
                    const std::string& help) {
  AddRow({name, *field ? "true" : "false", "true or false", help},
         [field](const std::string& value) -> const char* {
           if (value != "true" && value != "false") {
             return "is neither true nor false";
           }
           *field = value == "true";
           return nullptr;
         });
}

void OptionSet::Add(const std::string& name,
                    std::string* field,
                    const std::vector<std::string>& choices,
                    const std::string& help) {
  std::string allowed;
  for (const std::string& choice : choices) {
    allowed += (allowed.empty() ? "one of " : ", ") + choice;
  }
  AddRow(
      {name, *field, allowed, help},
      [field, choices](const std::string& value) -> const char* {
        if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
          return "is no choice";
        }
        *field = value;
        return nullptr;
      });
}

void OptionSet::AddNumberOrAuto(const std::string& name,
                                double* field,
                                const Range& range,
                                const std::string& help) {
  AddRow({name,
          std::isnan(*field) ? kAuto : NumberText(*field),
          RangeText(range) + " or " + kAuto,
          help},
         [field, range](const std::string& value) -> const char* {
           if (value == kAuto) {
             *field = std::numeric_limits<double>::quiet_NaN();
             return nullptr;
           }
           return SetNumber(value, range, kNotANumber, field);
         });
}

bool OptionSet::Set(const std::string& name,
                    const std::string& value,
                    std::string* error) {
  std::vector<std::string> names;
  for (size_t i = 0; i < rows_.size(); ++i) {
    if (rows_[i].name != name) {
      names.push_back(rows_[i].name);
      continue;
    }
    const char* complaint = setters_[i](value);
    if (complaint == nullptr) return true;
    std::ostringstream message;
    message << name << "=" << value << " " << complaint
            << "; allowed: " << rows_[i].allowed;
    *error = message.str();
    return false;
  }
  *error = UnknownNameMessage("option", name, names);
  return false;
}

bool OptionSet::SetAll(
    const std::vector<std::pair<std::string, std::string>>& settings,
    std::string* error) {
  for (size_t i = 0; i < settings.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (settings[j].first == settings[i].first) {
        *error = settings[i].first + " is given twice: " + settings[j].second +
                 " and " + settings[i].second;
        return false;
      }
    }
    if (!Set(settings[i].first, settings[i].second, error)) return false;
  }
  return true;
}

}  // namespace invgrad
