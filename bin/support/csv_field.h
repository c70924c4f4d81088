// A text as a field of a CSV file: in quotes, and its quotes doubled, where it
// has a comma, a quote or a line end. RFC 4180, section 2.
#ifndef BIN_SUPPORT_CSV_FIELD_H_
#define BIN_SUPPORT_CSV_FIELD_H_

#include <string>

namespace invgrad {

inline std::string CsvField(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

}  // namespace invgrad

#endif  // BIN_SUPPORT_CSV_FIELD_H_
