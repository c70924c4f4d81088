#include "report/table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

// The number of UTF-8 characters: all bytes except continuation bytes.
size_t Width(const std::string& text) {
  return std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  });
}

std::string Padded(const std::string& text, size_t width, Table::Align align) {
  const std::string space(width - Width(text), ' ');
  return align == Table::Align::kRight ? space + text : text + space;
}

std::string OnOneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

void TrimEnd(std::string* line) {
  line->erase(line->find_last_not_of(' ') + 1);
}

}  // namespace

std::string MarkdownCell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    cell += c == '|' ? "\\|" : std::string(1, c);
  }
  return cell;
}

Table::Table(std::vector<Column> columns) : columns_(std::move(columns)) {
  CHECK(!columns_.empty());
  for (Column& column : columns_) {
    column.title = OnOneLine(column.title);
  }
}

void Table::AddRow(std::vector<std::string> cells) {
  CHECK_EQ(cells.size(), columns_.size());
  for (std::string& cell : cells) {
    cell = OnOneLine(cell);
  }
  rows_.push_back(std::move(cells));
}

void Table::BeginRow() {
  if (!rows_.empty()) CHECK_EQ(rows_.back().size(), columns_.size());
  rows_.emplace_back();
}

void Table::Add(const std::string& title,
                const std::string& cell,
                Align align) {
  CHECK(!rows_.empty());
  const size_t j = rows_.back().size();
  if (rows_.size() == 1) columns_.push_back({OnOneLine(title), align});
  CHECK_LT(j, columns_.size());
  CHECK_EQ(columns_[j].title, OnOneLine(title));
  rows_.back().push_back(OnOneLine(cell));
}

std::string Table::ToText() const {
  std::vector<std::string> lines(rows_.size() + 2);
  for (size_t j = 0; j < columns_.size(); ++j) {
    const Column& column = columns_[j];
    size_t width = Width(column.title);
    for (const auto& row : rows_) {
      width = std::max(width, Width(row[j]));
    }
    const std::string gap = j > 0 ? "  " : "";
    lines[0] += gap + Padded(column.title, width, column.align);
    lines[1] += gap + std::string(width, '-');
    for (size_t i = 0; i < rows_.size(); ++i) {
      lines[i + 2] += gap + Padded(rows_[i][j], width, column.align);
    }
  }
  std::string text;
  for (std::string& line : lines) {
    TrimEnd(&line);
    text += line + '\n';
  }
  return text;
}

std::string Table::ToMarkdown() const {
  std::string text = "|";
  std::string rule = "|";
  for (const Column& column : columns_) {
    text += ' ' + MarkdownCell(column.title) + " |";
    rule += column.align == Align::kRight ? " ---: |" : " :--- |";
  }
  text += '\n' + rule + '\n';
  for (const auto& row : rows_) {
    text += '|';
    for (const std::string& cell : row) {
      text += ' ' + MarkdownCell(cell) + " |";
    }
    text += '\n';
  }
  return text;
}

std::string Table::ToCsv() const {
  std::string text;
  for (const Column& column : columns_) {
    text += (text.empty() ? "" : ",") + CsvField(column.title);
  }
  text += '\n';
  for (const auto& row : rows_) {
    for (size_t j = 0; j < row.size(); ++j) {
      text += (j > 0 ? "," : "") + CsvField(row[j]);
    }
    text += '\n';
  }
  return text;
}

std::string NumberOrDash(double value) {
  return std::isnan(value) ? "-" : FormatNumber(value);
}

std::string ExactNumber(double value) { return fmt::format("{:.17g}", value); }

}  // namespace invgrad
