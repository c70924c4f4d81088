#include "problems/estimation/nist_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

constexpr long kLargestCount = std::numeric_limits<int>::max();

// The content of a line of the head: a range of lines, or a count.
struct Statement {
  long line = 0;
  long first = 0;  // line, or the count itself
  long last = 0;   // line
};

class NistParser {
 public:
  NistParser(const std::string& text,
             const std::string& file,
             std::string* error)
      : cursor_(text, file, error) {}

  bool Parse(NistData* data) {
    if (!ParseHead() || !CheckLines() || !CheckCounts()) return false;
    if (!ParseParameters() || !ParseSummary() || !ParseData()) return false;
    *data = std::move(read_);
    return true;
  }

 private:
  bool Has(std::string_view kind) const { return head_.count(kind) > 0; }
  const Statement& Get(std::string_view kind) const { return head_.at(kind); }

  // The starting values end the head.
  bool ParseHead() {
    while (!Has("Starting") ||
           cursor_.line_number() + 1 < Get("Starting").first) {
      if (!cursor_.NextLine()) {
        return cursor_.FailAtToken("",
                                   "'Starting Values (lines A to B)' and the "
                                   "starting values on these lines");
      }
      if (!ParseHeadLine()) return false;
    }
    constexpr std::string_view kEnd = "the head ends";
    if (read_.name.empty()) return cursor_.Fail(kEnd, "'Dataset Name: NAME'");
    constexpr std::pair<std::string_view, std::string_view> kNeeded[] = {
        {"Certified", "'Certified Values (lines A to B)'"},
        {"Data", "'Data (lines A to B)'"},
        {"Predictor", "'P Predictors'"},
        {"Observation", "'M Observations'"},
        {"Parameter", "'N Parameters'"}};
    for (const auto& [kind, expected] : kNeeded) {
      if (!Has(kind)) return cursor_.Fail(kEnd, expected);
    }
    return true;
  }

  // The first statement of each kind is used, because later prose may begin
  // like a statement.
  bool ParseHeadLine() {
    const std::string_view first = cursor_.NextToken();
    const std::string_view second = cursor_.PeekToken();
    if (first == "Dataset" && second == "Name:" && read_.name.empty()) {
      cursor_.NextToken();
      read_.name = cursor_.NextToken();
      return !read_.name.empty() ||
             cursor_.FailAtToken("", "the data set's name");
    }
    const bool is_data = first == "Data" && second == "(lines";
    const bool is_values =
        second == "Values" && (first == "Starting" || first == "Certified");
    if ((is_data || is_values) && !Has(first)) {
      if (is_values) cursor_.NextToken();
      return ParseLines(first);
    }
    // The counts are below the prose.
    is_below_prose_ = is_below_prose_ || first == "Data:";
    if (is_below_prose_) ParseCount(first, second);
    return true;
  }

  // "(lines 41 to  43)".
  bool ParseLines(std::string_view kind) {
    Statement& lines = head_[kind];
    lines.line = cursor_.line_number();
    if (!cursor_.ReadWords("(lines") ||
        !cursor_.ReadInteger("the first line's number",
                             lines.line + 1,
                             kLargestCount,
                             &lines.first) ||
        !cursor_.ReadWords("to")) {
      return false;
    }
    const std::string_view token = cursor_.NextToken();
    if (token.empty() || token.back() != ')' ||
        !ParseInteger(token.substr(0, token.size() - 1), &lines.last)) {
      return cursor_.FailAtToken(token, "the last line's number and ')'");
    }
    return (lines.last >= lines.first && lines.last <= cursor_.num_lines()) ||
           cursor_.Fail(
               fmt::format(
                   "lines {} to {} are claimed", lines.first, lines.last),
               fmt::format("lines in order, up to line {}, where the text ends",
                           cursor_.num_lines()));
  }

  // "14 Observations", "1 Predictor Variable", "2 Parameters (b1 and b2)".
  void ParseCount(std::string_view number, std::string_view word) {
    if (!word.empty() && word.back() == 's') word.remove_suffix(1);
    long count = 0;
    if ((word == "Predictor" || word == "Parameter" || word == "Observation") &&
        ParseInteger(number, &count)) {
      head_.insert({word, {cursor_.line_number(), count, 0}});
    }
  }

  bool CheckLines() const {
    const Statement& certified = Get("Certified");
    if (certified.first != Get("Starting").first ||
        certified.last < Get("Starting").last) {
      return cursor_.FailOnLine(certified.line,
                                "the certified values are on other lines",
                                "lines that begin with the starting values'");
    }
    return Get("Data").first > certified.last ||
           cursor_.FailOnLine(
               Get("Data").line,
               "the data are not below the certified values",
               fmt::format("line {} at the earliest", certified.last + 1));
  }

  // The counts must agree with the ranges of lines.
  bool CheckCounts() const {
    const long num_starts = Get("Starting").last - Get("Starting").first + 1;
    const long num_rows = Get("Data").last - Get("Data").first + 1;
    return CheckCount("Parameter",
                      Get("Parameter").first == num_starts,
                      fmt::format("{}, as many as lines of starting values",
                                  num_starts)) &&
           CheckCount("Observation",
                      Get("Observation").first == num_rows,
                      fmt::format("{}, as many as lines of data", num_rows)) &&
           CheckCount(
               "Observation",
               num_rows >= num_starts,
               fmt::format("no fewer than the {} parameters", num_starts)) &&
           CheckCount("Predictor", Get("Predictor").first >= 1, "1 or more");
  }

  bool CheckCount(std::string kind,
                  bool is_right,
                  std::string_view expected) const {
    if (is_right) return true;
    const Statement& count = Get(kind);
    kind[0] = static_cast<char>(std::tolower(kind[0]));
    return cursor_.FailOnLine(
        count.line,
        fmt::format("{} {}s are claimed", count.first, kind),
        expected);
  }

  bool ParseParameters() {
    const long n = Get("Parameter").first;
    read_.starts.resize(n, 2);
    read_.certified.resize(n);
    read_.standard_deviations.resize(n);
    for (long i = 0; i < n; ++i) {
      cursor_.NextLine();
      if (!cursor_.ReadWords(fmt::format("b{} =", i + 1)) ||
          !cursor_.ReadNumber("starting value 1", &read_.starts(i, 0)) ||
          !cursor_.ReadNumber("starting value 2", &read_.starts(i, 1)) ||
          !cursor_.ReadNumber("the certified value", &read_.certified(i)) ||
          !ReadNonNegative("the standard deviation",
                           &read_.standard_deviations(i)) ||
          !cursor_.ReadLineEnd()) {
        return false;
      }
    }
    return true;
  }

  bool ReadNonNegative(const std::string& expected, double* value) {
    return cursor_.ReadNumber(expected, value) &&
           (*value >= 0.0 ||
            cursor_.Fail("a negative number", expected + ": 0 or more"));
  }

  // The lines after the parameters, up to the last certified value: four
  // values, each at most once, of which two are needed.
  bool ParseSummary() {
    std::set<std::string_view> found;
    const auto begins = [&](std::string_view label) {
      return found.count(label) == 0 && cursor_.SkipWords(label) &&
             found.insert(label).second;
    };
    constexpr std::string_view kSum = "Residual Sum of Squares:";
    constexpr std::string_view kCount = "Number of Observations:";
    while (cursor_.line_number() < Get("Certified").last &&
           cursor_.NextLine()) {
      if (cursor_.PeekToken().empty()) continue;
      bool is_read = false;
      if (begins(kSum)) {
        is_read = ReadNonNegative("the residual sum of squares",
                                  &read_.certified_sum_of_squares);
      } else if (begins("Residual Standard Deviation:")) {
        double deviation = 0.0;  // follows from the sum of squares
        is_read =
            ReadNonNegative("the residual standard deviation", &deviation);
      } else if (begins("Degrees of Freedom:")) {
        // Rat43.dat states 9, and has 15 observations and 4 parameters.
        long degrees = 0;
        is_read = cursor_.ReadInteger(
            "the degrees of freedom", 0, kLargestCount, &degrees);
      } else if (begins(kCount)) {
        long count = Get("Observation").first;
        is_read = cursor_.ReadInteger(
            "the number of observations", count, count, &count);
      } else {
        return cursor_.FailAtToken(
            cursor_.NextToken(),
            "one each of 'Residual Sum of Squares:', 'Residual Standard "
            "Deviation:', 'Degrees of Freedom:' and 'Number of "
            "Observations:'");
      }
      if (!is_read || !cursor_.ReadLineEnd()) return false;
    }
    for (const std::string_view label : {kSum, kCount}) {
      if (found.count(label) == 0) {
        return cursor_.Fail("the certified values end",
                            fmt::format("'{}'", label));
      }
    }
    return true;
  }

  bool ParseData() {
    const long m = Get("Observation").first;
    const long p = Get("Predictor").first;
    while (cursor_.line_number() + 1 < Get("Data").first) {
      cursor_.NextLine();  // a blank line and the names of the columns
    }
    // "0 0\n" is the shortest row of one predictor.
    if (!CheckCount("Predictor",
                    p < (cursor_.num_bytes_left() + 1) / (2 * m),
                    "as many as there are in the lines of data")) {
      return false;
    }
    read_.responses.resize(m);
    read_.predictors.resize(m, p);
    for (long i = 0; i < m; ++i) {
      cursor_.NextLine();
      if (!cursor_.ReadNumber("a response", &read_.responses(i))) return false;
      for (long j = 0; j < p; ++j) {
        double* predictor = &read_.predictors(i, j);
        if (!cursor_.ReadNumber("a predictor", predictor)) return false;
      }
      if (!cursor_.ReadLineEnd()) return false;
    }
    return cursor_.ReadTextEnd();
  }

  TextCursor cursor_;
  NistData read_;
  bool is_below_prose_ = false;
  // Starting, Certified, Data: lines; Predictor, Parameter, Observation:
  // counts.
  std::map<std::string_view, Statement> head_;
};

std::string Lines(long first, long last) {
  return fmt::format("(lines {} to {})\n", first, last);
}
std::string Count(long count, std::string_view thing) {
  return fmt::format("{} {}{}\n", count, thing, count == 1 ? "" : "s");
}

}  // namespace

bool ParseNist(const std::string& text,
               const std::string& file,
               NistData* data,
               std::string* error) {
  return NistParser(text, file, error).Parse(data);
}

std::string NistText(const NistData& data) {
  constexpr long kFirstStart = 41;  // as in NIST's files
  constexpr long kFirstRow = 61;
  const long n = data.certified.size();
  const long m = data.responses.size();
  const long last_start = kFirstStart + n - 1;
  const long last_certified = last_start + 5;
  const long first_row = std::max(kFirstRow, last_certified + 2);

  std::string text;
  const auto out = std::back_inserter(text);
  // Blank lines up to this one.
  const auto skip_to = [&text](long line) {
    const long next = std::count(text.begin(), text.end(), '\n') + 1;
    text.append(std::max(line - next, 0L), '\n');
  };
  const std::string indent(15, ' ');
  text += "NIST/ITL StRD\nDataset Name:  " + data.name + "\n\n";
  text += "File Format:   ASCII\n";
  text += indent + "Starting Values   " + Lines(kFirstStart, last_start);
  text += indent + "Certified Values  " + Lines(kFirstStart, last_certified);
  text += indent + "Data              " + Lines(first_row, first_row + m - 1);
  text += "\nData:          1 Response\n";
  text += indent + Count(data.predictors.cols(), "Predictor");
  text += indent + Count(m, "Observation");
  text += "\nModel:\n" + indent + Count(n, "Parameter");
  skip_to(kFirstStart - 1);
  text += "        Start 1     Start 2     Parameter     Standard Deviation\n";
  for (long i = 0; i < n; ++i) {
    fmt::format_to(out,
                   "  b{} =  {}  {}  {}  {}\n",
                   i + 1,
                   data.starts(i, 0),
                   data.starts(i, 1),
                   data.certified(i),
                   data.standard_deviations(i));
  }
  const double sum = data.certified_sum_of_squares;
  fmt::format_to(out, "\nResidual Sum of Squares:  {}\n", sum);
  fmt::format_to(out,
                 "Residual Standard Deviation:  {}\n",
                 std::sqrt(sum / static_cast<double>(std::max(m - n, 1L))));
  fmt::format_to(out, "Degrees of Freedom:  {}\n", m - n);
  fmt::format_to(out, "Number of Observations:  {}\n", m);
  skip_to(first_row - 1);
  text += "Data:   y  x\n";
  for (long i = 0; i < m; ++i) {
    fmt::format_to(out, "      {}", data.responses(i));
    for (const double x : data.predictors.row(i)) {
      fmt::format_to(out, "  {}", x);
    }
    text += '\n';
  }
  return text;
}

bool ReadNistFile(const std::string& path, NistData* data, std::string* error) {
  std::string text;
  return ReadFile(path, &text, error) && ParseNist(text, path, data, error);
}

bool WriteNistFile(const std::string& path,
                   const NistData& data,
                   std::string* error) {
  return WriteReadable(path, data, NistText, ParseNist, error);
}

}  // namespace invgrad
