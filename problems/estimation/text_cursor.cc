#include "problems/estimation/text_cursor.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "fmt/core.h"

namespace invgrad {
namespace {

constexpr std::string_view kSpace = " \t\r\v\f";

// Tokens of damaged files may be long and contain any bytes.
std::string Quote(std::string_view token) {
  constexpr size_t kMaxSize = 40;
  std::string quoted = "'";
  for (const char c : token.substr(0, kMaxSize)) {
    quoted += c >= ' ' && c <= '~' ? c : '?';
  }
  return quoted + (token.size() > kMaxSize ? "...'" : "'");
}

template <typename T>
bool ParseAll(std::string_view token, T* value) {
  const char* end = token.data() + token.size();
  const auto result = std::from_chars(token.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
}

}  // namespace

TextCursor::TextCursor(std::string_view text,
                       std::string_view file,
                       std::string* error)
    : rest_(text),
      file_(file),
      error_(error),
      num_lines_(std::count(text.begin(), text.end(), '\n') +
                 (!text.empty() && text.back() != '\n' ? 1 : 0)) {}

bool TextCursor::NextLine() {
  if (rest_.empty()) {
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

bool TextCursor::ReadNumber(std::string_view expected, double* value) {
  const std::string_view token = NextToken();
  // std::from_chars rejects a plus sign.
  const bool has_plus = token.size() > 1 && token[0] == '+' && token[1] != '-';
  if (!ParseAll(token.substr(has_plus ? 1 : 0), value) ||
      !std::isfinite(*value)) {
    return FailAtToken(token, fmt::format("{}: a finite double", expected));
  }
  return true;
}

bool TextCursor::ReadInteger(std::string_view expected,
                             long min,
                             long max,
                             long* value) {
  const std::string_view token = NextToken();
  if (!ParseAll(token, value) || *value < min || *value > max) {
    return FailAtToken(
        token,
        min == max
            ? fmt::format("{}: {}", expected, min)
            : fmt::format("{}: an integer from {} to {}", expected, min, max));
  }
  return true;
}

bool TextCursor::ReadWords(std::string_view words) {
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(' '));
    words.remove_prefix(std::min(word.size() + 1, words.size()));
    const std::string_view token = NextToken();
    if (token != word) return FailAtToken(token, Quote(word));
  }
  return true;
}

bool TextCursor::SkipWords(std::string_view words) {
  TextCursor copy = *this;
  std::string error;
  copy.error_ = &error;
  if (!copy.ReadWords(words)) return false;
  line_ = copy.line_;
  return true;
}

bool TextCursor::ReadLineEnd() {
  const std::string_view token = NextToken();
  return token.empty() || FailAtToken(token, "the line's end");
}

bool TextCursor::ReadTextEnd() {
  do {
    const std::string_view token = NextToken();
    if (!token.empty()) return FailAtToken(token, "the text's end");
  } while (NextLine());
  return true;
}

bool TextCursor::Fail(std::string_view what, std::string_view expected) const {
  return FailOnLine(line_number_, what, expected);
}

bool TextCursor::FailOnLine(long line_number,
                            std::string_view what,
                            std::string_view expected) const {
  *error_ = fmt::format("{}:{}: {}; expected {}",
                        file_,
                        std::max(line_number, 1L),
                        what,
                        expected);
  return false;
}

bool TextCursor::FailAtToken(std::string_view token,
                             std::string_view expected) const {
  if (!token.empty()) return Fail("found " + Quote(token), expected);
  if (num_lines_ == 0) return Fail("the text is empty", expected);
  return Fail(rest_.empty() ? "the text ends" : "the line ends", expected);
}

bool ParseInteger(std::string_view token, long* value) {
  return ParseAll(token, value);
}

}  // namespace invgrad
