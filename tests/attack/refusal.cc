#include "tests/attack/refusal.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "gtest/gtest.h"
#include "tests/attack/attack.h"
#include "tests/attack/run_files.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

// docs/programs.md, "Exit codes, signals, limits".
constexpr int kRefused = 1;
constexpr int kNothingWorked = 3;

bool IsControl(char c) {
  const auto code = static_cast<unsigned char>(c);
  return (code < ' ' && c != '\n') || code == 0x7f;
}

bool HasInternalError(const std::string& text) {
  const std::vector<std::string> signs = {"terminate called",
                                          "Check failed",
                                          "std::",
                                          "Sanitizer",
                                          "runtime error:",
                                          "filesystem error"};
  return std::any_of(signs.begin(), signs.end(), [&](const std::string& sign) {
    return text.find(sign) != std::string::npos;
  });
}

bool HasAny(const std::string& text, const std::vector<std::string>& names) {
  return names.empty() ||
         std::any_of(names.begin(), names.end(), [&](const std::string& name) {
           return text.find(name) != std::string::npos;
         });
}

// Without what a run notes of itself before it reads its earlier results.
Files FilesOfUser(const std::string& folder) {
  Files files = ReadFiles(folder);
  for (auto file = files.begin(); file != files.end();) {
    const fs::path name = fs::path(file->first).filename();
    const bool is_note =
        name == "files.txt" || name == "flags.txt" || name == "versions.txt";
    file = is_note ? files.erase(file) : std::next(file);
  }
  return files;
}

}  // namespace

Outcome RunOrRefuse(const Command& command,
                    const std::vector<std::string>& names) {
  const Files before = FilesOfUser(command.folder);
  Outcome outcome = RunChild(command);
  const Files after = FilesOfUser(command.folder);
  SCOPED_TRACE(ShellLine(command));
  constexpr size_t kMaxLength = 6000;
  const std::string text = outcome.text.substr(0, kMaxLength);
  EXPECT_EQ(outcome.signal, 0) << text;
  EXPECT_LE(outcome.exit_code, kNothingWorked) << text;
  EXPECT_EQ(std::count_if(text.begin(), text.end(), IsControl), 0) << text;
  EXPECT_FALSE(HasInternalError(text)) << text;
  if (outcome.exit_code == kRefused) {
    Count("refused");
    EXPECT_LT(outcome.text.size(), kMaxLength) << text;
    EXPECT_TRUE(HasAny(outcome.text, names))
        << "no '" << names[0] << "' in: " << text;
    // Bad input; the other reason is output that cannot be written.
    if (text.find("cannot write") == std::string::npos) {
      EXPECT_EQ(FindDifference(after, before), "") << text;
    }
  } else {
    Count("ran");
  }
  for (const auto& [path, content] : before) {
    if (fs::path(path).filename() == "keep") {
      EXPECT_EQ(after.count(path), 1) << path << " is lost\n" << text;
    }
  }
  return outcome;
}

}  // namespace invgrad
