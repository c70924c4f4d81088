// A table of text with aligned columns, for a terminal or as Markdown.
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

// As a cell of a Markdown table: a "|" in it is not the end of the cell.
std::string MarkdownCell(const std::string& text);

class Table {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string title;
    Align align = Align::kRight;
  };

  explicit Table(std::vector<Column> columns);

  void AddRow(std::vector<std::string> cells);

  std::string ToText() const;
  std::string ToMarkdown() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace invgrad

#endif  // REPORT_TABLE_H_
