// The pages of the documentation, for the tests that read them.
#ifndef INVGRAD_TESTS_DOCS_PAGES_H_
#define INVGRAD_TESTS_DOCS_PAGES_H_

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/source_tree.h"

namespace invgrad {

inline std::filesystem::path SourceRoot() { return SourceDir(); }

// Empty, with a failure, if the file cannot be read.
inline std::string ReadText(const std::filesystem::path& path) {
  std::string text;
  std::string error;
  EXPECT_TRUE(ReadFile(path.string(), &text, &error)) << error;
  return text;
}

inline std::vector<std::string> SplitLines(const std::string& text) {
  std::vector<std::string> lines;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

// README.md and all pages under docs.
inline std::vector<std::filesystem::path> Pages() {
  std::vector<std::filesystem::path> pages = {SourceRoot() / "README.md"};
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(SourceRoot() / "docs")) {
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  }
  return pages;
}

// "// [marker]" or "// [/marker]"; not "// [1] A source."
inline bool IsMarker(const std::string& text) {
  return text.rfind("// [", 0) == 0 && text.back() == ']';
}

// What stands between the lines "// [marker]" and "// [/marker]", without the
// indentation of the first of them. Markers may overlap; lines that are markers
// are not part of it. Empty, with a failure, unless both occur exactly once.
inline std::string MarkedRegion(const std::string& source,
                                const std::string& marker) {
  std::string region;
  size_t indentation = 0;
  int num_begins = 0;
  int num_ends = 0;
  for (const std::string& line : SplitLines(source)) {
    const size_t first = std::min(line.find_first_not_of(' '), line.size());
    const std::string text = line.substr(first);
    if (text == "// [" + marker + "]") {
      ++num_begins;
      indentation = first;
    } else if (text == "// [/" + marker + "]") {
      ++num_ends;
    } else if (num_begins == 1 && num_ends == 0 && !IsMarker(text)) {
      region += (first < indentation ? text : line.substr(indentation)) + "\n";
    }
  }
  EXPECT_EQ(num_begins, 1) << "// [" << marker << "]";
  EXPECT_EQ(num_ends, 1) << "// [/" << marker << "]";
  return num_begins == 1 && num_ends == 1 ? region : "";
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_DOCS_PAGES_H_
