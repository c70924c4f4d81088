// What a reader of texts must do with whatever it is given: refuse it with a
// message, or return data that it reads back, bit for bit, from what its writer
// makes of them. For tests and for fuzzers.
#ifndef INVGRAD_TESTS_READER_CHECK_H_
#define INVGRAD_TESTS_READER_CHECK_H_

#include <cctype>
#include <string>

namespace invgrad {

template <typename Data>
struct TextFormat {
  bool (*parse)(const std::string& text,
                const std::string& file,
                Data* data,
                std::string* error);
  // Two data have one text only if they are the same bit for bit.
  std::string (*write)(const Data& data);
};

// Empty, or what the reader or the writer did wrong.
template <typename Data>
std::string FindReaderFlaw(const TextFormat<Data>& format,
                           const std::string& text) {
  Data data;
  std::string error;
  if (!format.parse(text, "f", &data, &error)) {
    const bool has_line = error.size() > 2 && error.compare(0, 2, "f:") == 0 &&
                          std::isdigit(static_cast<unsigned char>(error[2]));
    if (!has_line || error.find("; expected ") == std::string::npos) {
      return "a poor message: " + error;
    }
    const bool is_unchanged = format.write(data) == format.write(Data());
    return is_unchanged ? "" : "a failure changed the data";
  }
  if (!error.empty()) {
    return "a message without a failure: " + error;
  }
  const std::string written = format.write(data);
  Data back;
  if (!format.parse(written, "f", &back, &error)) {
    return "what is written is not read: " + error;
  }
  return format.write(back) == written ? "" : "what is read back differs";
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_READER_CHECK_H_
