// What bash makes of a snippet: the commands that it starts, with their words.
#ifndef INVGRAD_TESTS_DOCS_RECORDER_H_
#define INVGRAD_TESTS_DOCS_RECORDER_H_

#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <regex>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/docs/snippets.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {

inline std::string Quoted(const std::string& word) {
  return "'" + std::regex_replace(word, std::regex("'"), "'\\''") + "'";
}

inline int RunInShell(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

inline void Write(const std::string& path, const std::string& text) {
  std::string error;
  ASSERT_TRUE(WriteFile(path, text, &error)) << error;
}

// A tree like that of a reader who has built the programs, in which programs,
// scripts and tools write down their names and arguments and do nothing.
class Recorder {
 public:
  Recorder() {
    for (const std::string& program : Programs()) {
      Add("build/release/bin/" + program);
    }
    for (const std::string& script : Scripts()) Add(script);
    for (const char* tool : {"c++",
                             "cmake",
                             "ctest",
                             "git",
                             "mkdir",
                             "mpirun",
                             "parallel",
                             "pkg-config",
                             "python3",
                             "sudo"}) {
      Add(std::string("tools/") + tool);
    }
    num_files_ = NumFiles();
  }

  // False with *error set if the snippet cannot be pasted.
  bool Expand(const Snippet& snippet,
              std::vector<Words>* commands,
              std::string* error) const {
    const std::string record = folder_ / "record";
    const std::string output = folder_ / "output";
    Write(record, "");
    Write(folder_ / "script", snippet.text);
    const std::string path =
        Tree() + "/tools" +
        (snippet.needs_path ? "" : ":" + Tree() + "/build/release/bin");
    const int exit_code = RunInShell(
        "cd " + Quoted(Tree()) + " && PATH=" + Quoted(path) +
        " RECORD=" + Quoted(record) + " /bin/bash -euo pipefail " +
        Quoted(folder_ / "script") + " > " + Quoted(output) + " 2>&1");
    *error = ReadText(output);
    if (exit_code != 0 || !error->empty()) return false;
    if (NumFiles() != num_files_) {
      *error = "it writes a file: is a \">\" without quotes?";
      return false;
    }
    *commands = Parse(ReadText(record));
    return true;
  }

 private:
  std::string Tree() const { return folder_ / "tree"; }

  void Add(const std::string& name) {
    const std::string path = Tree() + "/" + name;
    std::filesystem::create_directories(
        std::filesystem::path(path).parent_path());
    // Each word, and the command, ends with a zero.
    Write(path,
          "#!/bin/sh\nprintf '%s\\0' \"${0##*/}\" \"$@\" '' >> \"$RECORD\"\n");
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  }

  long NumFiles() const {
    return std::distance(std::filesystem::recursive_directory_iterator(Tree()),
                         std::filesystem::recursive_directory_iterator());
  }

  static std::vector<Words> Parse(const std::string& record) {
    std::vector<Words> commands;
    Words words;
    for (size_t begin = 0; begin < record.size();) {
      const size_t end = record.find('\0', begin);
      words.push_back(record.substr(begin, end - begin));
      begin = end + 1;
      if (words.back().empty()) {
        words.pop_back();
        commands.push_back(words);
        words.clear();
      }
    }
    return commands;
  }

  const TemporaryFolder folder_;
  long num_files_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_DOCS_RECORDER_H_
