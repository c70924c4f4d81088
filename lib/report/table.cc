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

}  // namespace

std::string MarkdownCell(const std::string& text) {
  std::string cell;
  for (const char c : text) cell += c == '|' ? "\\|" : std::string(1, c);
  return cell;
}

Table::Table(const std::vector<Column>& columns) : rows_(1) {
  for (const Column& column : columns) {
    aligns_.push_back(column.align);
    rows_[0].push_back(OnOneLine(column.title));
  }
}

void Table::AddRow(std::vector<std::string> cells) {
  CHECK_EQ(cells.size(), aligns_.size());
  for (std::string& cell : cells) cell = OnOneLine(cell);
  rows_.push_back(std::move(cells));
}

void Table::BeginRow() {
  CHECK_EQ(rows_.back().size(), aligns_.size());
  rows_.emplace_back();
}

void Table::Add(const std::string& title,
                const std::string& cell,
                Align align) {
  CHECK_GT(rows_.size(), 1u);
  const size_t j = rows_.back().size();
  if (rows_.size() == 2) {
    aligns_.push_back(align);
    rows_[0].push_back(OnOneLine(title));
  }
  CHECK_LT(j, aligns_.size());
  CHECK_EQ(rows_[0][j], OnOneLine(title)) << "another title";
  rows_.back().push_back(OnOneLine(cell));
}

std::string Table::ToText() const {
  std::vector<std::string> lines(rows_.size());
  std::string rule;
  for (size_t j = 0; j < aligns_.size(); ++j) {
    size_t width = 0;
    for (const auto& row : rows_) width = std::max(width, Width(row[j]));
    const std::string gap = j > 0 ? "  " : "";
    rule += gap + std::string(width, '-');
    for (size_t i = 0; i < rows_.size(); ++i) {
      lines[i] += gap + Padded(rows_[i][j], width, aligns_[j]);
    }
  }
  lines.insert(lines.begin() + 1, rule);
  std::string text;
  for (const std::string& line : lines) {
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

std::string Table::ToMarkdown() const {
  std::string text;
  for (size_t i = 0; i < rows_.size(); ++i) {
    text += '|';
    for (const std::string& cell : rows_[i]) {
      text += ' ' + MarkdownCell(cell) + " |";
    }
    text += '\n';
    if (i > 0) continue;
    text += '|';
    for (const Align align : aligns_) {
      text += align == Align::kRight ? " ---: |" : " :--- |";
    }
    text += '\n';
  }
  return text;
}

std::string Table::ToCsv() const {
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (size_t j = 0; j < row.size(); ++j) {
      line += (j > 0 ? "," : "") + CsvField(row[j]);
    }
    text += line + '\n';
  }
  return text;
}

std::string NumberOrDash(double value) {
  return std::isnan(value) ? "-" : FormatNumber(value);
}

std::string ExactNumber(double value) { return fmt::format("{:.17g}", value); }

}  // namespace invgrad
