#include "problems/estimation/nist_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "invgrad/io/atomic_file.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

constexpr long kLargestCount = std::numeric_limits<int>::max();

// What a line of the head states; line 0 if none did.
struct Statement {
  long line = 0;
  long first = 0;  // line, or the count itself
  long last = 0;   // line
};

bool IsMissing(const Statement& statement) { return statement.line == 0; }

class NistParser {
 public:
  NistParser(const std::string& text,
             const std::string& file,
             std::string* error)
      : cursor_(text, file, error) {}

  bool Parse(NistData* data) {
    if (!ParseHead() || !CheckLines() || !CheckCounts() || !ParseParameters() ||
        !ParseSummary() || !ParseData()) {
      return false;
    }
    *data = std::move(read_);
    return true;
  }

 private:
  // The head ends where the starting values begin.
  bool ParseHead() {
    while (cursor_.line_number() + 1 < starts_.first || IsMissing(starts_)) {
      if (!cursor_.NextLine()) {
        return cursor_.FailAtToken("",
                                   "'Starting Values (lines A to B)' and the "
                                   "starting values on these lines");
      }
      if (!ParseHeadLine()) {
        return false;
      }
    }
    return Require(!read_.name.empty(), "'Dataset Name: NAME'") &&
           Require(!IsMissing(certified_),
                   "'Certified Values (lines A to B)'") &&
           Require(!IsMissing(data_), "'Data (lines A to B)'") &&
           Require(!IsMissing(num_predictors_), "'P Predictors'") &&
           Require(!IsMissing(num_observations_), "'M Observations'") &&
           Require(!IsMissing(num_parameters_), "'N Parameters'");
  }

  bool Require(bool is_there, std::string_view expected) const {
    return is_there || cursor_.Fail("the head ends", expected);
  }

  // Only the first statement of a kind counts: the prose of other lines may
  // begin like one.
  bool ParseHeadLine() {
    const std::string_view first = cursor_.NextToken();
    const std::string_view second = cursor_.PeekToken();
    if (first == "Dataset" && second == "Name:" && read_.name.empty()) {
      cursor_.NextToken();
      read_.name = cursor_.NextToken();
      return !read_.name.empty() ||
             cursor_.FailAtToken("", "the data set's name");
    }
    if (second == "Values" && first == "Starting" && IsMissing(starts_)) {
      cursor_.NextToken();
      return ParseLines(&starts_);
    }
    if (second == "Values" && first == "Certified" && IsMissing(certified_)) {
      cursor_.NextToken();
      return ParseLines(&certified_);
    }
    if (second == "(lines" && first == "Data" && IsMissing(data_)) {
      return ParseLines(&data_);
    }
    // The counts stand below the prose.
    is_below_prose_ = is_below_prose_ || first == "Data:";
    if (is_below_prose_) {
      ParseCount(first, second);
    }
    return true;
  }

  // "(lines 41 to  43)".
  bool ParseLines(Statement* lines) {
    if (!cursor_.ReadWord("(lines") ||
        !cursor_.ReadInteger("the first line's number",
                             cursor_.line_number() + 1,
                             kLargestCount,
                             &lines->first) ||
        !cursor_.ReadWord("to")) {
      return false;
    }
    const std::string_view token = cursor_.NextToken();
    const char* end = token.data() + token.size();
    const auto result = std::from_chars(token.data(), end, lines->last);
    if (result.ec != std::errc() || end - result.ptr != 1 ||
        *result.ptr != ')') {
      return cursor_.FailAtToken(token, "the last line's number and ')'");
    }
    if (lines->last < lines->first || lines->last > cursor_.num_lines()) {
      return cursor_.Fail("lines " + std::to_string(lines->first) + " to " +
                              std::to_string(lines->last) + " are claimed",
                          "lines in order, up to line " +
                              std::to_string(cursor_.num_lines()) +
                              ", where the text ends");
    }
    lines->line = cursor_.line_number();
    return true;
  }

  // "14 Observations", "1 Predictor Variable", "2 Parameters (b1 and b2)".
  void ParseCount(std::string_view number, std::string_view word) {
    Statement* statement = nullptr;
    if (word == "Predictor" || word == "Predictors") {
      statement = &num_predictors_;
    } else if (word == "Parameter" || word == "Parameters") {
      statement = &num_parameters_;
    } else if (word == "Observation" || word == "Observations") {
      statement = &num_observations_;
    } else {
      return;
    }
    long count = 0;
    const char* end = number.data() + number.size();
    const auto result = std::from_chars(number.data(), end, count);
    if (IsMissing(*statement) && result.ec == std::errc() &&
        result.ptr == end) {
      *statement = {cursor_.line_number(), count, 0};
    }
  }

  bool CheckLines() const {
    if (certified_.first != starts_.first || certified_.last < starts_.last) {
      return cursor_.FailOnLine(certified_.line,
                                "the certified values are on other lines",
                                "lines that begin with the starting values'");
    }
    return data_.first > certified_.last ||
           cursor_.FailOnLine(data_.line,
                              "the data are not below the certified values",
                              "line " + std::to_string(certified_.last + 1) +
                                  " at the earliest");
  }

  // The counts stated must be those of the lines claimed, which are there.
  bool CheckCounts() const {
    const long num_starts = starts_.last - starts_.first + 1;
    const long num_rows = data_.last - data_.first + 1;
    if (num_parameters_.first != num_starts) {
      return FailAtCount(
          num_parameters_,
          " parameters are claimed",
          std::to_string(num_starts) + ", as many as lines of starting values");
    }
    if (num_observations_.first != num_rows) {
      return FailAtCount(
          num_observations_,
          " observations are claimed",
          std::to_string(num_rows) + ", as many as lines of data");
    }
    if (num_observations_.first < num_parameters_.first) {
      return FailAtCount(
          num_observations_,
          " observations are claimed",
          "no fewer than the " + std::to_string(num_starts) + " parameters");
    }
    return num_predictors_.first >= 1 ||
           FailAtCount(num_predictors_, " predictors are claimed", "1 or more");
  }

  bool FailAtCount(const Statement& count,
                   std::string_view what,
                   std::string_view expected) const {
    return cursor_.FailOnLine(
        count.line, std::to_string(count.first) + std::string(what), expected);
  }

  bool ParseParameters() {
    const long n = num_parameters_.first;
    read_.starts.resize(n, 2);
    read_.certified.resize(n);
    read_.standard_deviations.resize(n);
    for (long i = 0; i < n; ++i) {
      cursor_.NextLine();
      if (!cursor_.ReadWord("b" + std::to_string(i + 1)) ||
          !cursor_.ReadWord("=") ||
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

  // What follows the parameters, up to the last line of certified values.
  bool ParseSummary() {
    bool has_sum = false;
    bool has_deviation = false;
    bool has_degrees = false;
    bool has_observations = false;
    while (cursor_.line_number() < certified_.last && cursor_.NextLine()) {
      const std::string_view word = cursor_.NextToken();
      bool is_read = true;
      if (word.empty()) {
        continue;
      }
      if (word == "Residual" && cursor_.PeekToken() == "Sum" && !has_sum) {
        is_read = SkipWords({"Sum", "of", "Squares:"}) &&
                  ReadNonNegative("the residual sum of squares",
                                  &read_.certified_sum_of_squares);
        has_sum = true;
      } else if (word == "Residual" && !has_deviation) {
        double deviation = 0.0;  // follows from the sum of squares
        is_read =
            SkipWords({"Standard", "Deviation:"}) &&
            ReadNonNegative("the residual standard deviation", &deviation);
        has_deviation = true;
      } else if (word == "Degrees" && !has_degrees) {
        // Rat43.dat states 9, and has 15 observations and 4 parameters.
        long degrees = 0;
        is_read = SkipWords({"of", "Freedom:"}) &&
                  cursor_.ReadInteger(
                      "the degrees of freedom", 0, kLargestCount, &degrees);
        has_degrees = true;
      } else if (word == "Number" && !has_observations) {
        long count = num_observations_.first;
        is_read = SkipWords({"of", "Observations:"}) &&
                  cursor_.ReadInteger(
                      "the number of observations", count, count, &count);
        has_observations = true;
      } else {
        return cursor_.FailAtToken(
            word,
            "one each of 'Residual Sum of Squares:', 'Residual Standard "
            "Deviation:', 'Degrees of Freedom:' and 'Number of "
            "Observations:'");
      }
      if (!is_read || !cursor_.ReadLineEnd()) {
        return false;
      }
    }
    constexpr std::string_view kEnd = "the certified values end";
    return (has_sum || cursor_.Fail(kEnd, "'Residual Sum of Squares:'")) &&
           (has_observations ||
            cursor_.Fail(kEnd, "'Number of Observations:'"));
  }

  bool SkipWords(const std::vector<std::string_view>& words) {
    return std::all_of(
        words.begin(), words.end(), [this](std::string_view word) {
          return cursor_.ReadWord(word);
        });
  }

  bool ParseData() {
    const long m = num_observations_.first;
    const long p = num_predictors_.first;
    while (cursor_.line_number() + 1 < data_.first) {
      cursor_.NextLine();  // blank, and the names of the columns
    }
    // "0 0\n" is the shortest row of one predictor.
    if ((cursor_.num_bytes_left() + 1) / (2 * m) <= p) {
      return FailAtCount(num_predictors_,
                         " predictors are claimed",
                         "as many as there are in the lines of data");
    }
    read_.responses.resize(m);
    read_.predictors.resize(m, p);
    for (long i = 0; i < m; ++i) {
      cursor_.NextLine();
      if (!cursor_.ReadNumber("a response", &read_.responses(i))) {
        return false;
      }
      for (long j = 0; j < p; ++j) {
        if (!cursor_.ReadNumber("a predictor", &read_.predictors(i, j))) {
          return false;
        }
      }
      if (!cursor_.ReadLineEnd()) {
        return false;
      }
    }
    return cursor_.ReadTextEnd();
  }

  TextCursor cursor_;
  NistData read_;
  bool is_below_prose_ = false;
  Statement starts_;
  Statement certified_;
  Statement data_;
  Statement num_predictors_;
  Statement num_observations_;
  Statement num_parameters_;
};

// Builds a text whose parts begin on given lines.
class LineWriter {
 public:
  void Append(const std::string& line) {
    text_ += line + '\n';
    ++num_lines_;
  }
  void AppendRow(const std::string& head, const std::vector<double>& values) {
    std::string line = head;
    for (const double value : values) {
      line += "  ";
      AppendNumber(value, &line);
    }
    Append(line);
  }
  // Blank lines, so that the next one has this number.
  void SkipTo(long line) {
    while (num_lines_ + 1 < line) {
      Append("");
    }
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
  long num_lines_ = 0;
};

std::string Lines(long first, long last) {
  return "(lines " + std::to_string(first) + " to " + std::to_string(last) +
         ")";
}

std::string Count(long count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
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
  const long degrees_of_freedom = m - n;

  LineWriter writer;
  writer.Append("NIST/ITL StRD");
  writer.Append("Dataset Name:  " + data.name);
  writer.Append("");
  writer.Append("File Format:   ASCII");
  writer.Append("               Starting Values   " +
                Lines(kFirstStart, last_start));
  writer.Append("               Certified Values  " +
                Lines(kFirstStart, last_certified));
  writer.Append("               Data              " +
                Lines(first_row, first_row + m - 1));
  writer.Append("");
  writer.Append("Data:          1 Response");
  writer.Append("               " + Count(data.predictors.cols(), "Predictor"));
  writer.Append("               " + Count(m, "Observation"));
  writer.Append("");
  writer.Append("Model:");
  writer.Append("               " + Count(n, "Parameter"));

  writer.SkipTo(kFirstStart - 1);
  writer.Append(
      "        Start 1     Start 2     Parameter     Standard Deviation");
  for (long i = 0; i < n; ++i) {
    writer.AppendRow("  b" + std::to_string(i + 1) + " =",
                     {data.starts(i, 0),
                      data.starts(i, 1),
                      data.certified(i),
                      data.standard_deviations(i)});
  }
  writer.Append("");
  writer.AppendRow("Residual Sum of Squares:", {data.certified_sum_of_squares});
  writer.AppendRow(
      "Residual Standard Deviation:",
      {degrees_of_freedom == 0
           ? 0.0
           : std::sqrt(data.certified_sum_of_squares / degrees_of_freedom)});
  writer.Append("Degrees of Freedom:  " + std::to_string(degrees_of_freedom));
  writer.Append("Number of Observations:  " + std::to_string(m));

  writer.SkipTo(first_row - 1);
  writer.Append("Data:   y  x");
  for (long i = 0; i < m; ++i) {
    std::vector<double> row = {data.responses(i)};
    for (long j = 0; j < data.predictors.cols(); ++j) {
      row.push_back(data.predictors(i, j));
    }
    writer.AppendRow("    ", row);
  }
  return writer.text();
}

bool CheckNist(const NistData& data, std::string* error) {
  const long n = data.certified.size();
  const long m = data.responses.size();
  if (n == 0 || m < n || data.predictors.rows() != m ||
      data.predictors.cols() == 0 || data.starts.rows() != n ||
      data.starts.cols() != 2 || data.standard_deviations.size() != n) {
    *error = "the numbers of parameters, predictors and observations disagree";
    return false;
  }
  if (!data.responses.allFinite() || !data.predictors.allFinite() ||
      !data.starts.allFinite() || !data.certified.allFinite() ||
      !data.standard_deviations.allFinite() ||
      !std::isfinite(data.certified_sum_of_squares)) {
    *error = "a number is not finite";
    return false;
  }
  if (data.standard_deviations.minCoeff() < 0.0 ||
      data.certified_sum_of_squares < 0.0) {
    *error = "a standard deviation or the sum of squares is negative";
    return false;
  }
  if (data.name.empty() ||
      data.name.find_first_of(" \t\r\n\v\f") != std::string::npos) {
    *error = "the name '" + data.name + "' is not one word";
    return false;
  }
  return true;
}

bool ReadNistFile(const std::string& path, NistData* data, std::string* error) {
  std::string text;
  return ReadFile(path, &text, error) && ParseNist(text, path, data, error);
}

bool WriteNistFile(const std::string& path,
                   const NistData& data,
                   std::string* error) {
  std::string problem;
  if (!CheckNist(data, &problem)) {
    *error = "cannot write " + path + ": " + problem;
    return false;
  }
  return WriteFile(path, NistText(data), error);
}

}  // namespace invgrad
