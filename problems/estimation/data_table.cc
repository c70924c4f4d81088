#include "problems/estimation/data_table.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

constexpr std::string_view kBlank = " \t\r\v\f";  // as Trimmed

// In the order in which a line chooses.
constexpr std::string_view kSeparators = ";,\t ";

// The position after the quotes that begin at `begin`, in which "" is a quote;
// `begin` if none begin there, or if they do not end on the line.
std::size_t EndOfQuotes(std::string_view line, std::size_t begin) {
  if (begin >= line.size() || line[begin] != '"') return begin;
  for (std::size_t i = begin + 1; i < line.size(); ++i) {
    if (line[i] != '"') continue;
    if (i + 1 == line.size() || line[i + 1] != '"') return i + 1;
    ++i;
  }
  return begin;
}

// `line`: without the blanks around it.
char SeparatorOf(std::string_view line, bool begins_with_tab) {
  std::string unquoted;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool may_begin =
        i == 0 || kSeparators.find(line[i - 1]) != std::string_view::npos;
    if (may_begin) i = EndOfQuotes(line, i);
    if (i < line.size()) unquoted += line[i];
  }
  for (const char separator : kSeparators) {
    if (unquoted.find(separator) != std::string::npos) return separator;
  }
  return begins_with_tab ? '\t' : ' ';  // an empty cell and another
}

// The position after the cell that begins at `begin`.
std::size_t EndOfCell(std::string_view line,
                      std::size_t begin,
                      char separator) {
  const std::size_t first = line.find_first_not_of(" \r", begin);
  const std::size_t after =
      first < line.size() ? std::max(begin, EndOfQuotes(line, first)) : begin;
  return std::min(separator == ' ' ? line.find_first_of(kBlank, after)
                                   : line.find(separator, after),
                  line.size());
}

std::string WithoutQuotes(std::string_view cell) {
  if (cell.size() < 2 || EndOfQuotes(cell, 0) != cell.size()) {
    return std::string(cell);
  }
  std::string text;
  for (std::size_t i = 1; i + 1 < cell.size(); ++i) {
    text += cell[i];
    if (cell[i] == '"') ++i;  // the second of two
  }
  return text;
}

// As WithoutQuotes reads back.
std::string Quoted(const std::string& cell, char separator) {
  const std::string_view separators =
      kSeparators.substr(0, kSeparators.find(separator) + 1);
  const bool is_plain = cell.find_first_of(separators) == std::string::npos &&
                        cell.find('"') == std::string::npos &&
                        cell.rfind('#', 0) != 0 && Trimmed(cell) == cell &&
                        !(cell.empty() && separator == ' ');
  if (is_plain) return cell;
  std::string text = "\"";
  for (const char c : cell) text += c == '"' ? "\"\"" : std::string(1, c);
  return text + '"';
}

std::vector<std::string> CellsOf(std::string_view line, char separator) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = EndOfCell(line, begin, separator);
    cells.push_back(WithoutQuotes(Trimmed(line.substr(begin, end - begin))));
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

// Whether the first row has the names of the columns.
bool HasNames(const std::vector<std::string>& first) {
  return std::none_of(first.begin(), first.end(), IsNumber);
}

// Returns false, with *what, if formulas could not tell the columns apart.
bool NameColumns(const std::vector<std::string>& first,
                 DataTable* table,
                 std::string* what) {
  if (!HasNames(first)) {
    for (std::size_t k = 1; k <= first.size(); ++k) {
      table->names.push_back(fmt::format("c{}", k));
    }
    return true;
  }
  std::unordered_set<std::string> names;
  for (const std::string& name : first) {
    if (!CanStandInFormulas(name)) continue;
    if (name == "pi") {
      *what = "a column is called 'pi', as the number in formulas";
      return false;
    }
    if (names.insert(name).second) continue;
    *what = fmt::format("two columns are called '{}'", Printable(name, 40));
    return false;
  }
  table->names = first;
  return true;
}

// As formulas call the column.
std::string ColumnName(const DataTable& table, int column) {
  const std::string& name = table.names[column];
  return CanStandInFormulas(name) ? name : fmt::format("c{}", column + 1);
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

std::string DataTable::NewName(const std::string& name) const {
  std::string unused = name;
  for (int k = 2; FindColumn(unused) >= 0; ++k) {
    unused = fmt::format("{}_{}", name, k);
  }
  return unused;
}

bool ParseTable(const std::string& text,
                const std::string& file,
                DataTable* table,
                std::string* error) {
  TextCursor cursor(text, file, error);
  DataTable read;
  bool is_first = true;
  while (cursor.NextLine()) {
    const std::string_view whole = cursor.RestOfLine();
    const std::string_view line = Trimmed(whole);
    if (line.empty() || line[0] == '#') continue;
    if (is_first) read.separator = SeparatorOf(line, whole[0] == '\t');
    // The first and the last cell may be empty between tabs, but not in a first
    // row of numbers.
    std::vector<std::string> cells =
        CellsOf(read.separator == '\t' ? whole : line, read.separator);
    if (is_first ? !HasNames(cells) : cells.size() != read.names.size()) {
      cells = CellsOf(line, read.separator);  // tabs around the row
    }
    if (is_first) {
      is_first = false;
      std::string what;
      if (!NameColumns(cells, &read, &what)) {
        cursor.Fail(what, "another name for each");
      }
      if (HasNames(cells)) continue;
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
        Printable(ColumnName(table, column), 40));
    return false;
  }
  return true;
}

std::string TableText(const DataTable& table) {
  std::string text;
  const auto add = [&](const std::vector<std::string>& row) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (k > 0) text += table.separator;
      const bool is_edge = k == 0 || k + 1 == row.size();
      // Tabs at the ends of a line may be no separators.
      text += is_edge && row[k].empty() && table.separator == '\t'
                  ? "\"\""
                  : Quoted(row[k], table.separator);
    }
    text += '\n';
  };
  add(table.names);
  for (const std::vector<std::string>& row : table.rows) add(row);
  return text;
}

}  // namespace invgrad
