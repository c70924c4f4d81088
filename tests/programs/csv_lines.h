// Results of programs, by column name.
#ifndef INVGRAD_TESTS_PROGRAMS_CSV_LINES_H_
#define INVGRAD_TESTS_PROGRAMS_CSV_LINES_H_

#include <algorithm>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {

// Lines of a CSV file, by column name.
using CsvLines = std::vector<std::map<std::string, std::string>>;

inline CsvLines ReadCsv(const std::string& text) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields(1);
    bool is_quoted = false;
    for (const char c : line) {
      if (c == '"') {
        is_quoted = !is_quoted;
      } else if (c == ',' && !is_quoted) {
        fields.emplace_back();
      } else {
        fields.back() += c;
      }
    }
    return fields;
  };
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> names = split(line);
  CsvLines rows;
  while (std::getline(lines, line)) {
    const std::vector<std::string> fields = split(line);
    EXPECT_EQ(fields.size(), names.size()) << line;
    std::map<std::string, std::string> row;
    for (size_t i = 0; i < std::min(fields.size(), names.size()); ++i) {
      row[names[i]] = fields[i];
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PROGRAMS_CSV_LINES_H_
