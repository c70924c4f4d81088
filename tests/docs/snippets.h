// The commands that a reader of the documentation pastes: blocks marked ```sh,
// spans of the text such as `compare --list`, and the sample runs at the top of
// each program.
#ifndef INVGRAD_TESTS_DOCS_SNIPPETS_H_
#define INVGRAD_TESTS_DOCS_SNIPPETS_H_

#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/docs/pages.h"

namespace invgrad {

using Words = std::vector<std::string>;

inline bool StartsWith(const std::string& text, const std::string& start) {
  return text.rfind(start, 0) == 0;
}

// Those of bin/*.cc, docs/tutorials/*.cc and docs/examples/*.cc.
inline std::set<std::string> Programs() {
  std::set<std::string> programs;
  const auto add = [&programs](const char* folder, const std::string& prefix) {
    for (const auto& entry :
         std::filesystem::directory_iterator(SourceRoot() / folder)) {
      if (entry.path().extension() == ".cc") {
        programs.insert(prefix + entry.path().stem().string());
      }
    }
  };
  add("bin", "");
  add("docs/tutorials", "");
  add("docs/examples", "example_");
  return programs;
}

// Paths of the scripts from the root.
inline Words Scripts() {
  Words scripts = {".ci/run"};
  for (const auto& entry :
       std::filesystem::directory_iterator(SourceRoot() / "bin")) {
    if (entry.path().extension() == ".sh") {
      scripts.push_back("bin/" + entry.path().filename().string());
    }
  }
  return scripts;
}

// What a reader pastes at once: a block of a page, a span of its text, or a
// sample run of a program.
struct Snippet {
  std::string text;
  // A block must name programs by their path, build/release/bin/compare.
  bool needs_path = false;
};

// The first word's file name: "compare" of "build/release/bin/compare --list".
inline std::string CommandName(const std::string& command) {
  std::istringstream words(command);
  std::string word;
  words >> word;
  return std::filesystem::path(word).filename().string();
}

// Also fails for commands in blocks that are not marked ```sh.
inline std::vector<Snippet> PageSnippets(const std::string& page) {
  const std::set<std::string> programs = Programs();
  std::vector<Snippet> snippets;
  std::string text;  // outside of blocks, on one line
  const std::vector<std::string> lines = SplitLines(page);
  for (size_t i = 0; i < lines.size(); ++i) {
    const size_t indentation = lines[i].find_first_not_of(' ');
    if (indentation == std::string::npos ||
        lines[i].compare(indentation, 3, "```") != 0) {
      text += lines[i] + " ";
      continue;
    }
    const std::string language = lines[i].substr(indentation + 3);
    std::string block;
    for (++i; i < lines.size() && lines[i].find("```") != indentation; ++i) {
      block += lines[i] + "\n";
    }
    if (language == "sh") {
      snippets.push_back({block, true});
    } else if (language.empty()) {
      EXPECT_EQ(programs.count(CommandName(block)), 0u)
          << "a command in a block that does not begin with ```sh: " << block;
    }
  }
  for (size_t at = text.find('`'); at != std::string::npos;) {
    const size_t end = text.find('`', at + 1);
    if (end == std::string::npos) break;
    const std::string span = text.substr(at + 1, end - at - 1);
    if (programs.count(CommandName(span)) > 0 &&
        span.find(" --") != std::string::npos) {
      snippets.push_back({span + "\n", false});
    }
    at = text.find('`', end + 1);
  }
  return snippets;
}

// The indented paragraph below "Sample runs:" in a program's first comment.
inline std::vector<Snippet> SampleRuns(const std::string& source) {
  Snippet snippet;
  bool is_below = false;
  for (std::string line : SplitLines(source)) {
    if (StartsWith(line, "//")) line = line.substr(2);
    const bool is_indented = StartsWith(line, "  ");
    if (is_below && is_indented) {
      snippet.text += line + "\n";
    } else if (!snippet.text.empty()) {
      return {snippet};
    } else if (line == "Sample runs:" || line == " Sample runs:") {
      is_below = true;
    }
  }
  return {};
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_DOCS_SNIPPETS_H_
