// Reads the lines, tokens and numbers of a text, independently of the locale.
//
//   TextCursor cursor(text, "x.g2o", &error);
//   while (cursor.NextLine()) {
//     const std::string_view tag = cursor.NextToken();
//     if (!cursor.ReadNumber("an angle", &angle)) return false;
//     ...
//
// Tokens are separated by spaces, tabs and carriage returns, so that lines may
// end as in Windows. The Read functions return false, as Fail does, with
// *error = "FILE:LINE: found 'nan'; expected an angle: a finite double".
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

  // `expected` completes "expected ...", for example "the focal length".
  bool ReadNumber(std::string_view expected, double* value);
  bool ReadInteger(std::string_view expected, long min, long max, long* value);
  // Requires these tokens, given with single spaces: "of Squares:".
  bool ReadWords(std::string_view words);
  // Moves behind these tokens; returns false, and stays, if others follow.
  bool SkipWords(std::string_view words);
  bool ReadLineEnd();
  // Requires that no tokens follow, on this line or later ones.
  bool ReadTextEnd();

  // Sets *error to a message about the current line.
  bool Fail(std::string_view what, std::string_view expected) const;
  bool FailOnLine(long line_number,
                  std::string_view what,
                  std::string_view expected) const;
  // Fails with "found 'token'", "the line ends" or "the text ends".
  bool FailAtToken(std::string_view token, std::string_view expected) const;

 private:
  std::string_view rest_;  // after the current line
  std::string_view line_;  // the unread part of the current line
  std::string_view file_;
  std::string* error_;
  long num_lines_;
  long line_number_ = 0;
};

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
