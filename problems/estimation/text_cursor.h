// Reads the lines, tokens and numbers of a text, and appends numbers to one
// such that they read back bit for bit; neither knows a locale.
//
//   TextCursor cursor(text, "x.g2o", &error);
//   while (cursor.NextLine()) {
//     const std::string_view tag = cursor.NextToken();
//     if (!cursor.ReadNumber("an angle", &angle)) return false;
//     ...
//
// Tokens are separated by spaces, tabs and carriage returns, so that lines may
// end as in Windows. Every member that reads returns false, like Fail, with
// *error = "FILE:LINE: found 'nan'; expected an angle: a finite double".
//
// Cost:    linear in the size of the text, which must outlive the cursor.
#ifndef PROBLEMS_ESTIMATION_TEXT_CURSOR_H_
#define PROBLEMS_ESTIMATION_TEXT_CURSOR_H_

#include <string>
#include <string_view>

namespace invgrad {

class TextCursor {
 public:
  TextCursor(std::string_view text, std::string_view file, std::string* error);

  // Of all the text; what follows the last line's end is a line unless empty.
  long num_lines() const { return num_lines_; }
  // Counted from 1; 0 before the first call of NextLine.
  long line_number() const { return line_number_; }
  // Bytes behind the current line.
  long num_bytes_left() const { return static_cast<long>(rest_.size()); }

  // Goes to the begin of the next line; false, and the cursor stays at the last
  // line's end, if there is none.
  bool NextLine();
  // Empty at the line's end.
  std::string_view NextToken();
  std::string_view PeekToken() const;

  // `expected` completes "expected ...", for example "the focal length".
  bool ReadNumber(std::string_view expected, double* value);
  bool ReadInteger(std::string_view expected, long min, long max, long* value);
  // Takes exactly this token.
  bool ReadWord(std::string_view word);
  bool ReadLineEnd();
  // Only blank lines follow.
  bool ReadTextEnd();

  // Says what is wrong on the current line.
  bool Fail(std::string_view what, std::string_view expected) const;
  bool FailOnLine(long line_number,
                  std::string_view what,
                  std::string_view expected) const;
  // Fail with "found 'token'", "the line ends" or "the text ends".
  bool FailAtToken(std::string_view token, std::string_view expected) const;

 private:
  std::string_view rest_;  // behind line_
  std::string_view line_;  // what of the current line is unread
  std::string_view file_;
  std::string* error_;
  long num_lines_;
  long line_number_ = 0;
};

// The fewest digits that read back as the same double.
void AppendNumber(double value, std::string* text);
void AppendNumber(long value, std::string* text);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_TEXT_CURSOR_H_
