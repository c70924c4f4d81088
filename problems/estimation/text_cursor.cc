#include "problems/estimation/text_cursor.h"

#include <algorithm>
#include <charconv>
#include <system_error>

#include "fmt/core.h"
#include "invgrad/core/specification.h"

namespace invgrad {
namespace {

constexpr std::string_view kSpace = " \t\r\v\f";

// Tokens of damaged files may be long.
std::string Quote(std::string_view token) {
  constexpr size_t kMaxSize = 40;
  return "'" + Printable(token, kMaxSize) + "'";
}

}  // namespace

std::string_view WithoutByteOrderMark(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  return text.substr(0, kMark.size()) == kMark ? text.substr(kMark.size())
                                               : text;
}

TextCursor::TextCursor(std::string_view text,
                       std::string_view file,
                       std::string* error)
    : rest_(WithoutByteOrderMark(text)),
      file_(file),
      error_(error),
      num_lines_(std::count(text.begin(), text.end(), '\n') +
                 (!text.empty() && text.back() != '\n' ? 1 : 0)) {}

bool TextCursor::NextLine() {
  if (rest_.empty() || !ok_) {
    line_ = {};
    return false;
  }
  const size_t size = std::min(rest_.find('\n'), rest_.size());
  line_ = rest_.substr(0, size);
  rest_.remove_prefix(std::min(size + 1, rest_.size()));
  ++line_number_;
  return true;
}

std::string_view TextCursor::NextToken() {
  const std::string_view token = PeekToken();
  if (token.empty()) {
    line_ = {};
  } else {
    line_.remove_prefix(token.data() + token.size() - line_.data());
  }
  return token;
}

std::string_view TextCursor::PeekToken() const {
  const size_t begin = std::min(line_.find_first_not_of(kSpace), line_.size());
  const size_t end = std::min(line_.find_first_of(kSpace, begin), line_.size());
  return line_.substr(begin, end - begin);
}

double TextCursor::Number(std::string_view expected) {
  const std::string_view token = NextToken();
  double value = 0.0;
  if (ParseFinite(token, &value)) return value;
  FailAtToken(token, fmt::format("{}: a finite double", expected));
  return 0.0;
}

long TextCursor::Integer(std::string_view expected, long min, long max) {
  const std::string_view token = NextToken();
  long value = 0;
  if (ParseInteger(token, &value) && value >= min && value <= max) return value;
  FailAtToken(
      token,
      min == max
          ? fmt::format("{}: {}", expected, min)
          : fmt::format("{}: an integer from {} to {}", expected, min, max));
  return min;
}

void TextCursor::Words(std::string_view words) {
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(' '));
    words.remove_prefix(std::min(word.size() + 1, words.size()));
    const std::string_view token = NextToken();
    if (token != word) FailAtToken(token, Quote(word));
  }
}

bool TextCursor::SkipWords(std::string_view words) {
  TextCursor ahead = *this;
  std::string unused;
  ahead.error_ = &unused;
  ahead.Words(words);
  if (ahead.ok_) line_ = ahead.line_;
  return ahead.ok_;
}

void TextCursor::EndLine() {
  const std::string_view token = NextToken();
  if (!token.empty()) FailAtToken(token, "the line's end");
}

void TextCursor::EndText() {
  do {
    const std::string_view token = NextToken();
    if (!token.empty()) FailAtToken(token, "the text's end");
  } while (NextLine());
}

void TextCursor::Fail(std::string_view what, std::string_view expected) {
  FailOnLine(line_number_, what, expected);
}

void TextCursor::FailOnLine(long line_number,
                            std::string_view what,
                            std::string_view expected) {
  if (!ok_) return;
  *error_ = fmt::format("{}:{}: {}; expected {}",
                        file_,
                        std::max(line_number, 1L),
                        what,
                        expected);
  ok_ = false;
  line_ = {};
}

void TextCursor::FailAtToken(std::string_view token,
                             std::string_view expected) {
  const char* const what = num_lines_ == 0 ? "the text is empty"
                           : rest_.empty() ? "the text ends"
                                           : "the line ends";
  Fail(token.empty() ? what : "found " + Quote(token), expected);
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() &&
         text.substr(text.size() - end.size()) == end;
}

bool ParseInteger(std::string_view token, long* value) {
  const char* const end = token.data() + token.size();
  const auto result = std::from_chars(token.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

}  // namespace invgrad
