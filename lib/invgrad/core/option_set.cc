#include "invgrad/option_set.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "fmt/core.h"
#include "fmt/ranges.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

constexpr char kAuto[] = "auto";

// The shortest text that reads back as the same number: "0.1", "1e-06".
std::string NumberText(double value) {
  char buffer[32];
  const std::to_chars_result result =
      std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, result.ptr);
}

// "100000", where NumberText has "1e+05".
std::string IntegerText(double value) {
  return std::isinf(value) ? NumberText(value) : fmt::format("{:.0f}", value);
}

std::string RangeText(const Range& range,
                      std::string (*text_of)(double) = NumberText) {
  const bool open_low = range.open_low || std::isinf(range.low);
  const bool open_high = range.open_high || std::isinf(range.high);
  return fmt::format("{}{}, {}{}",
                     open_low ? '(' : '[',
                     text_of(range.low),
                     text_of(range.high),
                     open_high ? ')' : ']');
}

bool Contains(const Range& range, double value) {
  return (range.open_low ? value > range.low : value >= range.low) &&
         (range.open_high ? value < range.high : value <= range.high);
}

// Number is double or int. std::from_chars accepts no spaces and ignores the
// locale.
template <typename Number>
const char* SetNumber(const std::string& text,
                      const Range& range,
                      Number* field) {
  const char* const end = text.data() + text.size();
  Number value = 0;
  const std::from_chars_result result =
      std::from_chars(text.data(), end, value);
  if (result.ec == std::errc::result_out_of_range && result.ptr == end) {
    return std::is_same_v<Number, int> ? "is out of the range of 32 bits"
                                       : "is out of a double's range";
  }
  if (result.ec != std::errc() || result.ptr != end ||
      !std::isfinite(static_cast<double>(value))) {
    return std::is_same_v<Number, int> ? "is not an integer"
                                       : "is not a finite number";
  }
  if (!Contains(range, value)) return "is out of range";
  *field = value;
  return nullptr;
}

}  // namespace

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
           return SetNumber(value, range, field);
         });
}

void OptionSet::Add(const std::string& name,
                    int* field,
                    const Range& range,
                    const std::string& help) {
  AddRow({name,
          std::to_string(*field),
          "integer in " + RangeText(range, IntegerText),
          help},
         [field, range](const std::string& value) {
           return SetNumber(value, range, field);
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
  AddRow(
      {name, *field, fmt::format("one of {}", fmt::join(choices, ", ")), help},
      [field, choices](const std::string& value) -> const char* {
        if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
          return "is no choice";
        }
        *field = value;
        return nullptr;
      });
}

void OptionSet::Add(const std::string& name,
                    std::optional<double>* field,
                    const Range& range,
                    const std::string& help) {
  AddRow({name,
          *field ? NumberText(**field) : kAuto,
          RangeText(range) + " or " + kAuto,
          help},
         [field, range](const std::string& value) -> const char* {
           std::optional<double> number;
           if (value != kAuto) {
             const char* const complaint =
                 SetNumber(value, range, &number.emplace());
             if (complaint != nullptr) return complaint;
           }
           *field = number;
           return nullptr;
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
    *error = fmt::format("{}={} {}; allowed: {}",
                         name,
                         Printable(value),
                         complaint,
                         rows_[i].allowed);
    return false;
  }
  *error = UnknownNameMessage("option", name, names);
  return false;
}

bool OptionSet::SetAll(const Settings& settings, std::string* error) {
  for (size_t i = 0; i < settings.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (settings[j].first == settings[i].first) {
        *error = fmt::format("{} is given twice: {} and {}",
                             Printable(settings[i].first),
                             Printable(settings[j].second),
                             Printable(settings[i].second));
        return false;
      }
    }
    if (!Set(settings[i].first, settings[i].second, error)) return false;
  }
  return true;
}

}  // namespace invgrad
