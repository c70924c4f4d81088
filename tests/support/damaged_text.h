// Small texts, and what may become of them.
#ifndef INVGRAD_TESTS_DAMAGED_TEXT_H_
#define INVGRAD_TESTS_DAMAGED_TEXT_H_

#include <filesystem>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/source_tree.h"

namespace invgrad {

// With another line `number`, counted from 1.
inline std::string ReplaceLine(const std::string& text,
                               int number,
                               const std::string& line) {
  size_t begin = 0;
  for (int i = 1; i < number; ++i) {
    begin = text.find('\n', begin) + 1;
    CHECK_NE(begin, 0) << "line " << number << " of\n" << text;
  }
  const size_t end = text.find('\n', begin);
  CHECK_NE(end, std::string::npos);
  return text.substr(0, begin) + line + text.substr(end);
}

// As Windows ends lines.
inline std::string WithCrLf(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '\n') {
      result += '\r';
    }
    result += c;
  }
  return result;
}

// Every prefix, then single bytes replaced: half of them by any byte, half by
// one that has a meaning in numbers and lines.
inline std::vector<std::string> DamagedTexts(const std::string& text) {
  std::vector<std::string> texts;
  for (size_t size = 0; size < text.size(); ++size) {
    texts.push_back(text.substr(0, size));
  }
  constexpr std::string_view kMeaningful = "0123456789+-.einfa#:=() \t\r\n";
  constexpr int kNumReplacements = 3000;
  std::mt19937 random(1);
  for (int i = 0; i < kNumReplacements; ++i) {
    std::string damaged = text;
    damaged[random() % text.size()] =
        i % 2 == 0 ? static_cast<char>(random() % 256)
                   : kMeaningful[random() % kMeaningful.size()];
    texts.push_back(std::move(damaged));
  }
  return texts;
}

// The texts that the fuzzer of a reader starts from, and those it once found.
inline std::vector<std::string> FuzzCorpus(const std::string& reader) {
  std::vector<std::string> texts;
  for (const auto& entry : std::filesystem::directory_iterator(
           SourceDir() + "/tests/fuzz/corpus/" + reader)) {
    std::string error;
    CHECK(ReadFile(entry.path(), &texts.emplace_back(), &error)) << error;
  }
  return texts;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_DAMAGED_TEXT_H_
