#include "problems/estimation/data_table.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/core/specification.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

constexpr std::string_view kBlank = " \t\r";

std::string_view WithoutBlanks(std::string_view text) {
  const std::size_t begin =
      std::min(text.find_first_not_of(kBlank), text.size());
  const std::size_t end = text.find_last_not_of(kBlank);
  return end == std::string_view::npos ? std::string_view()
                                       : text.substr(begin, end + 1 - begin);
}

char SeparatorOf(std::string_view line) {
  for (const char separator : {';', ',', '\t'}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return ' ';
}

// The position after the cell that begins at `begin`.
std::size_t EndOfCell(std::string_view line,
                      std::size_t begin,
                      char separator) {
  return std::min(separator == ' ' ? line.find_first_of(kBlank, begin)
                                   : line.find(separator, begin),
                  line.size());
}

std::vector<std::string> CellsOf(std::string_view line, char separator) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = EndOfCell(line, begin, separator);
    std::string_view cell = WithoutBlanks(line.substr(begin, end - begin));
    if (cell.size() > 1 && cell.front() == '"' && cell.back() == '"') {
      cell = cell.substr(1, cell.size() - 2);
    }
    cells.emplace_back(cell);
    if (end == line.size()) return cells;
    begin = separator == ' ' ? line.find_first_not_of(kBlank, end) : end + 1;
  }
}

bool IsNumber(const std::string& cell) {
  double value = 0.0;
  return ParseFinite(cell, &value);
}

// Letters, digits and underscores.
bool CanStandInFormulas(const std::string& name) {
  return !name.empty() &&
         std::isdigit(static_cast<unsigned char>(name[0])) == 0 &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '_';
         });
}

// Returns false if two columns have the name *twice.
bool NameColumns(const std::vector<std::string>& first,
                 DataTable* table,
                 std::string* twice) {
  if (std::all_of(first.begin(), first.end(), IsNumber)) {
    for (std::size_t k = 1; k <= first.size(); ++k) {
      table->names.push_back(fmt::format("c{}", k));
    }
    return true;
  }
  std::unordered_set<std::string> names;
  for (const std::string& name : first) {
    if (names.insert(name).second) continue;
    *twice = name;
    return false;
  }
  table->names = first;
  return true;
}

}  // namespace

int DataTable::FindColumn(const std::string& name) const {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<int>(found - names.begin());
  long number = 0;
  if (name.size() < 2 || name[0] != 'c' ||
      !ParseInteger(std::string_view(name).substr(1), &number) || number < 1 ||
      number > static_cast<long>(names.size())) {
    return -1;
  }
  const auto column = static_cast<int>(number) - 1;
  if (!CanStandInFormulas(names[column])) return column;
  return -1;
}

bool ParseTable(const std::string& text,
                const std::string& file,
                DataTable* table,
                std::string* error) {
  TextCursor cursor(text, file, error);
  DataTable read;
  bool is_first = true;
  while (cursor.NextLine()) {
    const std::string_view line = WithoutBlanks(cursor.RestOfLine());
    if (line.empty() || line[0] == '#') continue;
    if (is_first) read.separator = SeparatorOf(line);
    std::vector<std::string> cells = CellsOf(line, read.separator);
    if (is_first) {
      is_first = false;
      std::string twice;
      if (!NameColumns(cells, &read, &twice)) {
        cursor.Fail(
            fmt::format("two columns are called '{}'", Printable(twice, 40)),
            "another name for each");
      }
      if (!std::all_of(cells.begin(), cells.end(), IsNumber)) continue;
    }
    if (cells.size() != read.names.size()) {
      cursor.Fail(fmt::format("the row has {} cells", cells.size()),
                  fmt::format("{}, as the first row", read.names.size()));
    }
    read.rows.push_back(std::move(cells));
    read.line_numbers.push_back(cursor.line_number());
  }
  if (read.rows.empty()) cursor.FailAtToken("", "a row of numbers");
  if (cursor.ok()) *table = std::move(read);
  return cursor.ok();
}

bool ReadColumn(const DataTable& table,
                int column,
                const std::string& file,
                Eigen::VectorXd* values,
                std::string* error) {
  values->resize(static_cast<Eigen::Index>(table.rows.size()));
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::string& cell = table.rows[i][column];
    if (ParseFinite(cell, &(*values)[static_cast<Eigen::Index>(i)])) continue;
    *error = fmt::format(
        "{}:{}: found '{}' in the column {}; expected a finite number",
        file,
        table.line_numbers[i],
        Printable(cell, 40),
        Printable(table.names[column], 40));
    return false;
  }
  return true;
}

std::string TableText(const DataTable& table) {
  const std::string separator(1, table.separator);
  std::string text = fmt::format("{}\n", fmt::join(table.names, separator));
  for (const std::vector<std::string>& row : table.rows) {
    text += fmt::format("{}\n", fmt::join(row, separator));
  }
  return text;
}

}  // namespace invgrad
