// Reads and writes tables: .csv, .tsv, or columns with spaces between.
//
//   # a comment
//   time,signal
//   0.5,1.25
//
// The first row decides: its separator is a semicolon, else a comma, else a tab,
// if it has one outside of quotes, and white space otherwise; it has the names
// of the columns if none of its cells is a number. Without names, and with a
// name that cannot stand in a formula, column k, from 1, is called ck. Quotes
// around a cell are removed: separators in them are text, and "" is a quote.
// Blank lines and lines that start with # are skipped.
//
// Cost:    linear in the size of the text, which also bounds the memory.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if there
//          is no row of data, a row has another number of cells than the first,
//          two columns have one name that can stand in a formula, or a column
//          is called pi. *table is then unchanged.
#ifndef PROBLEMS_ESTIMATION_DATA_TABLE_H_
#define PROBLEMS_ESTIMATION_DATA_TABLE_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct DataTable {
  char separator = ',';            // or ; or a tab or, for white space, a space
  std::vector<std::string> names;  // of the columns
  std::vector<std::vector<std::string>> rows;  // of cells
  std::vector<long> line_numbers;              // of the rows

  // -1 if there is none.
  int FindColumn(const std::string& name) const;

  // "fit", or, if there is such a column, "fit_2", "fit_3", ...
  std::string NewName(const std::string& name) const;
};

// `file`: the name of the text in messages.
bool ParseTable(const std::string& text,
                const std::string& file,
                DataTable* table,
                std::string* error);

// The cells of a column, which must be finite numbers.
bool ReadColumn(const DataTable& table,
                int column,
                const std::string& file,
                Eigen::VectorXd* values,
                std::string* error);

// Formats `table`, with names, as text that ParseTable reads back.
std::string TableText(const DataTable& table);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_DATA_TABLE_H_
