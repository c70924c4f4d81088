// Reads the lines, tokens and numbers of a text, independently of the locale.
//
//   TextCursor cursor(text, "x.g2o", &error);
//   while (cursor.NextLine()) {
//     const std::string_view tag = cursor.NextToken();
//     const double angle = cursor.Number("an angle");
//     ...
//   if (!cursor.ok()) return false;
//
// A byte-order mark of UTF-8, which editors of Windows put first, is skipped.
// Tokens are separated by spaces, tabs and carriage returns, so that lines may
// end as in Windows. The first failure sets
// *error = "FILE:LINE: found 'nan'; expected an angle: a finite double". After
// a failure there are no more tokens and lines, and *error does not change.
//
// Cost:    linear in the size of the text, which must outlive the cursor.
#ifndef PROBLEMS_ESTIMATION_TEXT_CURSOR_H_
#define PROBLEMS_ESTIMATION_TEXT_CURSOR_H_

#include <string>
#include <string_view>

#include "invgrad/io/atomic_file.h"

namespace invgrad {

class TextCursor {
 public:
  TextCursor(std::string_view text, std::string_view file, std::string* error);

  // Whether nothing has failed.
  bool ok() const { return ok_; }

  // The number of lines of the text; text after the last line end is a line.
  long num_lines() const { return num_lines_; }
  // From 1; 0 before the first call of NextLine.
  long line_number() const { return line_number_; }
  // After the current line.
  long num_bytes_left() const { return static_cast<long>(rest_.size()); }

  // Moves to the start of the next line. If there is none, returns false and
  // stays at the end of the last line.
  bool NextLine();
  // Empty at the line's end.
  std::string_view NextToken();
  std::string_view PeekToken() const;
  // What is left of the current line, with its spaces.
  std::string_view RestOfLine() const { return line_; }

  // `expected` completes "expected ...", for example "the focal length". After
  // a failure 0 or `min`.
  double Number(std::string_view expected);
  long Integer(std::string_view expected, long min, long max);
  // Requires these tokens, given with single spaces: "of Squares:".
  void Words(std::string_view words);
  // Skips these tokens; returns false, and does not move, if others follow.
  bool SkipWords(std::string_view words);
  void EndLine();
  // Requires that no tokens follow, on this line or later ones.
  void EndText();

  // Fails with a message about the current line.
  void Fail(std::string_view what, std::string_view expected);
  void FailOnLine(long line_number,
                  std::string_view what,
                  std::string_view expected);
  // Fails with "found 'token'", "the line ends" or "the text ends".
  void FailAtToken(std::string_view token, std::string_view expected);

 private:
  std::string_view rest_;  // after the current line
  std::string_view line_;  // the unread part of the current line
  std::string_view file_;
  std::string* error_;
  bool ok_ = true;
  long num_lines_;
  long line_number_ = 0;
};

// Without the byte-order mark of UTF-8, if it begins with one.
std::string_view WithoutByteOrderMark(std::string_view text);

bool EndsWith(std::string_view text, std::string_view end);

// Whether all of the token is an integer.
bool ParseInteger(std::string_view token, long* value);

// Writes text_of(data) to a file, if `parse` reads the same data from it.
// Returns false, with *error set, if not (NaN), or if the file is not written.
template <typename Data>
bool WriteReadable(const std::string& path,
                   const Data& data,
                   std::string (*text_of)(const Data& data),
                   bool (*parse)(const std::string& text,
                                 const std::string& file,
                                 Data* data,
                                 std::string* error),
                   std::string* error) {
  const std::string text = text_of(data);
  const std::string failure = "cannot write " + path;
  Data back;
  if (!parse(text, failure, &back, error)) return false;
  if (text_of(back) == text) return WriteFile(path, text, error);
  *error = failure + ": it would be read as other data";
  return false;
}

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_TEXT_CURSOR_H_
