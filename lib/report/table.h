// A table of text: aligned for a terminal, as Markdown, or as CSV.
//
//   rule          ms/step  status
//   ------------  -------  --------
//   half_inverse      1.1  ok
//   gauss_newton     12.5  diverged
//
// Widths count UTF-8 characters. Line ends within a cell become spaces.
//
// Fails:   CHECKs that every row has as many cells as there are columns.
#ifndef REPORT_TABLE_H_
#define REPORT_TABLE_H_

#include <string>
#include <vector>

namespace invgrad {

// Escapes the "|" that would end a cell of a Markdown table.
std::string MarkdownCell(const std::string& text);

class Table {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string title;
    Align align = Align::kRight;
  };

  explicit Table(const std::vector<Column>& columns);
  void AddRow(std::vector<std::string> cells);

  // Or cell by cell: the first row defines the columns, and the others must
  // have the same columns (CHECKed).
  Table() : Table(std::vector<Column>()) {}
  void BeginRow();
  void Add(const std::string& title,
           const std::string& cell,
           Align align = Align::kRight);

  // The titles come first.
  const std::vector<std::vector<std::string>>& rows() const { return rows_; }
  const std::vector<Align>& aligns() const { return aligns_; }  // of columns

  std::string ToText() const;
  std::string ToMarkdown() const;
  // RFC 4180, with quotes only where they are needed.
  std::string ToCsv() const;

 private:
  std::vector<Align> aligns_;  // of the columns
  std::vector<std::vector<std::string>> rows_;
};

// Numbers as cells: by FormatNumber, "-" for NaN; and with all digits.
std::string NumberOrDash(double value);
std::string ExactNumber(double value);

}  // namespace invgrad

#endif  // REPORT_TABLE_H_
