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

// Lines of a CSV file without quoted commas, by column name.
using CsvLines = std::vector<std::map<std::string, std::string>>;

inline CsvLines ReadCsv(const std::string& text) {
  const auto split = [](const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream stream(line + ",");
    for (std::string field; std::getline(stream, field, ',');) {
      if (field.size() > 1 && field.front() == '"') {
        field = field.substr(1, field.size() - 2);
      }
      fields.push_back(field);
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
