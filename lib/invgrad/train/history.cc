#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string_view>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/train.h"

namespace invgrad {
namespace {

constexpr size_t kNumFields = 1 + std::size(kHistoryColumns);

std::string HeaderLine() {
  std::string line = "step";
  for (const HistoryColumn& column : kHistoryColumns) {
    line += fmt::format(",{}", column.name);
  }
  return line;
}

// std::to_chars and std::from_chars ignore the locale, whose decimal comma
// would split a number into two fields.
template <typename T>
void Append(T value, std::string* text) {
  char buffer[32];  // the longest double has 24 characters
  const auto result = std::to_chars(buffer, buffer + sizeof(buffer), value);
  text->append(buffer, result.ptr);
}

template <typename T>
bool Parse(std::string_view field, T* value) {
  const char* end = field.data() + field.size();
  const auto result = std::from_chars(field.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

// Returns an error message, or an empty string.
std::string ParseRow(std::string_view line, HistoryRow* row) {
  const std::vector<std::string_view> fields = Split(line, ',');
  if (fields.size() != kNumFields) {
    return fmt::format("found {} fields, wanted {}", fields.size(), kNumFields);
  }
  const auto wrong = [](std::string_view field) {
    return fmt::format("found '{}', wanted a number", Printable(field));
  };
  if (!Parse(fields[0], &row->step)) return wrong(fields[0]);
  for (size_t i = 1; i < kNumFields; ++i) {
    double* value = &(row->*kHistoryColumns[i - 1].value);
    *value = HistoryRow::kNone;
    if (!fields[i].empty() && !Parse(fields[i], value)) return wrong(fields[i]);
  }
  return "";
}

}  // namespace

bool WriteHistory(const std::string& path,
                  const History& history,
                  std::string* error) {
  std::string text = HeaderLine() + '\n';
  for (const HistoryRow& row : history) {
    Append(row.step, &text);
    for (const HistoryColumn& column : kHistoryColumns) {
      text += ',';
      const double value = row.*column.value;
      if (!std::isnan(value)) Append(value, &text);
    }
    text += '\n';
  }
  return WriteFile(path, text, error);
}

bool ReadHistory(const std::string& path,
                 History* history,
                 std::string* error) {
  std::string bytes;
  constexpr std::uint64_t kMaxSize = 1 << 28;  // some million rows
  if (!ReadFile(path, &bytes, error, kMaxSize)) return false;
  const std::vector<std::string_view> lines = Split(bytes, '\n');
  const auto fail = [&](size_t line, const std::string& problem) {
    *error = fmt::format("file {}, line {}: {}", path, line, problem);
    return false;
  };
  if (lines[0] != HeaderLine()) {
    return fail(1, "wanted the header " + HeaderLine());
  }
  // The last number may be truncated.
  if (!lines.back().empty()) {
    return fail(lines.size(), "the line does not end (truncated?)");
  }
  History rows(lines.size() - 2);
  for (size_t i = 0; i < rows.size(); ++i) {
    const std::string problem = ParseRow(lines[i + 1], &rows[i]);
    if (!problem.empty()) return fail(i + 2, problem);
  }
  *history = std::move(rows);
  return true;
}

}  // namespace invgrad
