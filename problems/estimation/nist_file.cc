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

#include "fmt/ranges.h"
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
    ParseHead();
    if (cursor_.ok()) CheckHead();
    if (cursor_.ok()) ParseParameters();
    if (cursor_.ok()) ParseSummary();
    if (cursor_.ok()) ParseData();
    if (cursor_.ok()) *data = std::move(read_);
    return cursor_.ok();
  }

 private:
  bool Has(std::string_view kind) const { return head_.count(kind) > 0; }
  const Statement& Get(std::string_view kind) const { return head_.at(kind); }

  // The starting values end the head.
  void ParseHead() {
    while (!Has("Starting") ||
           cursor_.line_number() + 1 < Get("Starting").first) {
      if (!cursor_.NextLine()) {
        return cursor_.FailAtToken("",
                                   "'Starting Values (lines A to B)' and the "
                                   "starting values on these lines");
      }
      ParseHeadLine();
    }
    constexpr std::string_view kEnd = "the head ends";
    if (read_.name.empty()) cursor_.Fail(kEnd, "'Dataset Name: NAME'");
    constexpr std::pair<std::string_view, std::string_view> kNeeded[] = {
        {"Certified", "'Certified Values (lines A to B)'"},
        {"Data", "'Data (lines A to B)'"},
        {"Predictor", "'P Predictors'"},
        {"Observation", "'M Observations'"},
        {"Parameter", "'N Parameters'"}};
    for (const auto& [kind, expected] : kNeeded) {
      if (!Has(kind)) cursor_.Fail(kEnd, expected);
    }
  }

  // The first statement of each kind is used, because later prose may begin
  // like a statement.
  void ParseHeadLine() {
    const std::string_view first = cursor_.NextToken();
    const std::string_view second = cursor_.PeekToken();
    if (first == "Dataset" && second == "Name:" && read_.name.empty()) {
      cursor_.NextToken();
      read_.name = cursor_.NextToken();
      if (read_.name.empty()) cursor_.FailAtToken("", "the data set's name");
      return;
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
  }

  // "(lines 41 to  43)".
  void ParseLines(std::string_view kind) {
    Statement& lines = head_[kind];
    lines.line = cursor_.line_number();
    cursor_.Words("(lines");
    lines.first = cursor_.Integer(
        "the first line's number", lines.line + 1, kLargestCount);
    cursor_.Words("to");
    const std::string_view token = cursor_.NextToken();
    if (token.empty() || token.back() != ')' ||
        !ParseInteger(token.substr(0, token.size() - 1), &lines.last)) {
      cursor_.FailAtToken(token, "the last line's number and ')'");
    }
    if (lines.last < lines.first || lines.last > cursor_.num_lines()) {
      cursor_.Fail(
          fmt::format("lines {} to {} are claimed", lines.first, lines.last),
          fmt::format("lines in order, up to line {}, where the text ends",
                      cursor_.num_lines()));
    }
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

  // The ranges of lines are in order, and the counts agree with them.
  void CheckHead() {
    const Statement& starts = Get("Starting");
    const Statement& certified = Get("Certified");
    const Statement& data = Get("Data");
    const long n = starts.last - starts.first + 1;
    const long m = data.last - data.first + 1;
    if (certified.first != starts.first || certified.last < starts.last) {
      cursor_.FailOnLine(certified.line,
                         "the certified values are on other lines",
                         "lines that begin with the starting values'");
    }
    if (data.first <= certified.last) {
      cursor_.FailOnLine(
          data.line,
          "the data are not below the certified values",
          fmt::format("line {} at the earliest", certified.last + 1));
    }
    CheckCount("Parameter",
               Get("Parameter").first == n,
               fmt::format("{}, as many as lines of starting values", n));
    CheckCount("Observation",
               Get("Observation").first == m,
               fmt::format("{}, as many as lines of data", m));
    CheckCount("Observation",
               m >= n,
               fmt::format("no fewer than the {} parameters", n));
    CheckCount("Predictor", Get("Predictor").first >= 1, "1 or more");
  }

  void CheckCount(std::string kind, bool is_right, std::string_view expected) {
    if (is_right) return;
    const Statement& count = Get(kind);
    kind[0] = static_cast<char>(std::tolower(kind[0]));
    cursor_.FailOnLine(count.line,
                       fmt::format("{} {}s are claimed", count.first, kind),
                       expected);
  }

  void ParseParameters() {
    const long n = Get("Parameter").first;
    read_.starts.resize(n, 2);
    read_.certified.resize(n);
    read_.standard_deviations.resize(n);
    for (long i = 0; i < n; ++i) {
      cursor_.NextLine();
      cursor_.Words(fmt::format("b{} =", i + 1));
      read_.starts(i, 0) = cursor_.Number("starting value 1");
      read_.starts(i, 1) = cursor_.Number("starting value 2");
      read_.certified(i) = cursor_.Number("the certified value");
      read_.standard_deviations(i) = NonNegative("the standard deviation");
      cursor_.EndLine();
    }
  }

  double NonNegative(const std::string& expected) {
    const double value = cursor_.Number(expected);
    if (value < 0.0) {
      cursor_.Fail("a negative number", expected + ": 0 or more");
    }
    return value;
  }

  // The lines after the parameters, up to the last certified value: four
  // values, each at most once, of which two are needed.
  void ParseSummary() {
    constexpr std::string_view kSum = "Residual Sum of Squares:";
    constexpr std::string_view kCount = "Number of Observations:";
    std::set<std::string_view> found;
    const auto begins = [&](std::string_view label) {
      return found.count(label) == 0 && cursor_.SkipWords(label) &&
             found.insert(label).second;
    };
    while (cursor_.line_number() < Get("Certified").last &&
           cursor_.NextLine()) {
      if (cursor_.PeekToken().empty()) continue;
      if (begins(kSum)) {
        read_.certified_sum_of_squares =
            NonNegative("the residual sum of squares");
      } else if (begins("Residual Standard Deviation:")) {
        NonNegative("the residual standard deviation");  // follows from the sum
      } else if (begins("Degrees of Freedom:")) {
        // Rat43.dat states 9, and has 15 observations and 4 parameters.
        cursor_.Integer("the degrees of freedom", 0, kLargestCount);
      } else if (begins(kCount)) {
        const long m = Get("Observation").first;
        cursor_.Integer("the number of observations", m, m);
      } else {
        cursor_.FailAtToken(
            cursor_.NextToken(),
            "one each of 'Residual Sum of Squares:', 'Residual Standard "
            "Deviation:', 'Degrees of Freedom:' and 'Number of "
            "Observations:'");
      }
      cursor_.EndLine();
    }
    for (const std::string_view label : {kSum, kCount}) {
      if (found.count(label) == 0) {
        cursor_.Fail("the certified values end", fmt::format("'{}'", label));
      }
    }
  }

  void ParseData() {
    const long m = Get("Observation").first;
    const long p = Get("Predictor").first;
    while (cursor_.line_number() + 1 < Get("Data").first) {
      cursor_.NextLine();  // a blank line and the names of the columns
    }
    // "0 0\n" is the shortest row of one predictor.
    CheckCount("Predictor",
               p < (cursor_.num_bytes_left() + 1) / (2 * m),
               "as many as there are in the lines of data");
    if (!cursor_.ok()) return;  // before memory is allocated
    read_.responses.resize(m);
    read_.predictors.resize(m, p);
    for (long i = 0; i < m; ++i) {
      cursor_.NextLine();
      read_.responses(i) = cursor_.Number("a response");
      for (double& x : read_.predictors.row(i)) {
        x = cursor_.Number("a predictor");
      }
      cursor_.EndLine();
    }
    cursor_.EndText();
  }

  TextCursor cursor_;
  NistData read_;
  bool is_below_prose_ = false;
  // Starting, Certified, Data: lines; Predictor, Parameter, Observation:
  // counts.
  std::map<std::string_view, Statement> head_;
};

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
  const auto lines = [out](const char* what, long first, long last) {
    fmt::format_to(out, "{:15}{:18}(lines {} to {})\n", "", what, first, last);
  };
  const auto count = [out](long number, const char* what) {
    fmt::format_to(
        out, "{:15}{} {}{}\n", "", number, what, number == 1 ? "" : "s");
  };
  fmt::format_to(out, "NIST/ITL StRD\nDataset Name:  {}\n\n", data.name);
  text += "File Format:   ASCII\n";
  lines("Starting Values", kFirstStart, last_start);
  lines("Certified Values", kFirstStart, last_certified);
  lines("Data", first_row, first_row + m - 1);
  text += "\nData:          1 Response\n";
  count(data.predictors.cols(), "Predictor");
  count(m, "Observation");
  text += "\nModel:\n";
  count(n, "Parameter");
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
  fmt::format_to(out,
                 "\nResidual Sum of Squares:  {}\n"
                 "Residual Standard Deviation:  {}\n"
                 "Degrees of Freedom:  {}\nNumber of Observations:  {}\n",
                 sum,
                 std::sqrt(sum / static_cast<double>(std::max(m - n, 1L))),
                 m - n,
                 m);
  skip_to(first_row - 1);
  text += "Data:   y  x\n";
  for (long i = 0; i < m; ++i) {
    const Eigen::VectorXd x = data.predictors.row(i);
    fmt::format_to(out,
                   "      {}  {}\n",
                   data.responses(i),
                   fmt::join(x.begin(), x.end(), "  "));
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

std::function<
    bool(const std::string& path, const Eigen::VectorXd& b, std::string* error)>
NistWriter(const NistData& data) {
  return [data](const std::string& path,
                const Eigen::VectorXd& b,
                std::string* error) {
    NistData result = data;
    result.starts.colwise() = b;
    return WriteNistFile(path, result, error);
  };
}

}  // namespace invgrad
