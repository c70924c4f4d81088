#include "invgrad/train/history.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string_view>
#include <utility>

#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

constexpr std::string_view kHeader =
    "step,epoch,seconds,batch_loss,train_loss,test_loss,step_norm,metric,"
    "by_inverse,by_numerical_inverse,by_inverse_gradient,by_gradient,"
    "not_moved";

// The columns after the first, in the header's order.
constexpr double HistoryRow::*kColumns[] = {&HistoryRow::epoch,
                                            &HistoryRow::seconds,
                                            &HistoryRow::batch_loss,
                                            &HistoryRow::train_loss,
                                            &HistoryRow::test_loss,
                                            &HistoryRow::step_norm,
                                            &HistoryRow::metric,
                                            &HistoryRow::by_inverse,
                                            &HistoryRow::by_numerical_inverse,
                                            &HistoryRow::by_inverse_gradient,
                                            &HistoryRow::by_gradient,
                                            &HistoryRow::not_moved};
static_assert(std::size(kColumns) == HistoryRow::kNumColumns);

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

// Splits off the text before the first `separator`, or all of it.
std::string_view TakeUntil(char separator, std::string_view* text) {
  const size_t size = std::min(text->find(separator), text->size());
  const std::string_view head = text->substr(0, size);
  text->remove_prefix(std::min(size + 1, text->size()));
  return head;
}

bool ParseRow(std::string_view line, HistoryRow* row, std::string* problem) {
  const long num_fields = std::count(line.begin(), line.end(), ',') + 1;
  const long num_wanted = std::size(kColumns) + 1;
  if (num_fields != num_wanted) {
    *problem = "found " + std::to_string(num_fields) + " fields, wanted " +
               std::to_string(num_wanted);
    return false;
  }
  std::string_view field = TakeUntil(',', &line);
  bool is_read = Parse(field, &row->step);
  for (const auto column : kColumns) {
    if (!is_read) {
      break;
    }
    field = TakeUntil(',', &line);
    row->*column = HistoryRow::kNone;
    is_read = field.empty() || Parse(field, &(row->*column));
  }
  if (!is_read) {
    *problem = "found '" + std::string(field) + "', wanted a number";
  }
  return is_read;
}

}  // namespace

std::array<double, HistoryRow::kNumColumns> HistoryRow::Columns() const {
  std::array<double, kNumColumns> columns;
  for (int i = 0; i < kNumColumns; ++i) columns[i] = this->*kColumns[i];
  return columns;
}

void HistoryRow::SetColumns(const std::array<double, kNumColumns>& columns) {
  for (int i = 0; i < kNumColumns; ++i) this->*kColumns[i] = columns[i];
}

Eigen::VectorXd PackHistory(const History& history) {
  std::vector<double> numbers;
  for (const HistoryRow& row : history) {
    numbers.push_back(static_cast<double>(row.step));
    const auto columns = row.Columns();
    numbers.insert(numbers.end(), columns.begin(), columns.end());
  }
  return Eigen::Map<const Eigen::VectorXd>(
      numbers.data(), static_cast<Eigen::Index>(numbers.size()));
}

bool UnpackHistory(const Eigen::VectorXd& array, History* history) {
  constexpr Eigen::Index kRowSize = 1 + HistoryRow::kNumColumns;
  if (array.size() == 0 || array.size() % kRowSize != 0) return false;
  history->clear();
  for (Eigen::Index i = 0; i < array.size(); i += kRowSize) {
    HistoryRow row;
    row.step = static_cast<long>(array[i]);
    std::array<double, HistoryRow::kNumColumns> columns;
    std::copy_n(array.data() + i + 1, columns.size(), columns.begin());
    row.SetColumns(columns);
    history->push_back(row);
  }
  return true;
}

bool WriteHistory(const std::string& path,
                  const History& history,
                  std::string* error) {
  std::string text(kHeader);
  text += '\n';
  for (const HistoryRow& row : history) {
    Append(row.step, &text);
    for (const auto column : kColumns) {
      text += ',';
      if (!std::isnan(row.*column)) {
        Append(row.*column, &text);
      }
    }
    text += '\n';
  }
  return WriteFile(path, text, error);
}

bool ReadHistory(const std::string& path,
                 History* history,
                 std::string* error) {
  CHECK(history != nullptr);
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) {
    return false;
  }
  int line_number = 1;
  const auto fail = [&](const std::string& problem) {
    *error = "file " + path + ", line " + std::to_string(line_number) + ": " +
             problem;
    return false;
  };
  std::string_view rest = bytes;
  if (TakeUntil('\n', &rest) != kHeader) {
    return fail("wanted the header " + std::string(kHeader));
  }
  if (bytes.back() != '\n') {
    // The last number may be truncated.
    line_number = std::count(bytes.begin(), bytes.end(), '\n') + 1;
    return fail("the line does not end (truncated?)");
  }
  History rows;
  while (!rest.empty()) {
    ++line_number;
    std::string problem;
    if (!ParseRow(TakeUntil('\n', &rest), &rows.emplace_back(), &problem)) {
      return fail(problem);
    }
  }
  *history = std::move(rows);
  return true;
}

}  // namespace invgrad
