// Command lines that a program must refuse, and garbage for every flag of every
// program.

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/attack/attack.h"
#include "tests/attack/child.h"
#include "tests/attack/command_lines.h"
#include "tests/attack/refusal.h"
#include "tests/attack/runs.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace command_line_test {

constexpr char kCompare[] =
    "compare --problem=toy_network:num_samples=16 --rules=adam --steps=2 "
    "--plots=false --progress=false";
constexpr char kEstimate[] =
    "estimate --methods=ceres_lm --max_iterations=2 --plots=false "
    "--progress=false";

// With $C and $E replaced.
std::string Expanded(const std::string& line) {
  const std::string name = line.substr(0, 2);
  const std::string program = name == "$C"   ? kCompare
                              : name == "$E" ? kEstimate
                                             : name;
  return program + line.substr(name.size());
}

std::vector<std::string> SplitWords(const std::string& line) {
  std::vector<std::string> words(1);
  bool is_quoted = false;
  for (const char c : line) {
    if (c == '\'') {
      is_quoted = !is_quoted;
    } else if (c == ' ' && !is_quoted) {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

void WriteNistFile(const std::string& path) {
  std::string error;
  ASSERT_TRUE(WriteFile(path, SmallNistFile(), &error)) << error;
}

// Every row of command_lines.h.
TEST(CommandLineAttack, WhatIsWrongIsRefusedWithItsName) {
  for (const CommandLineRow& row : CommandLineRows()) {
    const TemporaryFolder folder;
    if ((row.prepare + row.line).find("in.dat") != std::string::npos) {
      WriteNistFile(folder / "in.dat");
    }
    const std::string prepare = fmt::format(
        "cd {} && PATH={}:$PATH C='{}' E='{}' && {{ {} ; }} "
        ">/dev/null 2>&1",
        folder / "",
        BinDir(),
        kCompare,
        kEstimate,
        row.prepare.empty() ? ":" : row.prepare);
    ASSERT_EQ(std::system(prepare.c_str()), 0) << prepare;
    SCOPED_TRACE(row.prepare);
    std::vector<std::string> words = SplitWords(Expanded(row.line));
    Command command;
    command.program = words[0];
    command.arguments.assign(words.begin() + 1, words.end());
    command.folder = folder / "";
    command.output = row.output;
    command.environment = row.environment;
    const Outcome outcome = RunOrRefuse(command, {row.says});
    EXPECT_EQ(outcome.exit_code, row.exit_code) << ShellLine(command) << "\n"
                                                << outcome.text;
    EXPECT_NE(outcome.text.find(row.says), std::string::npos)
        << ShellLine(command) << "\nno '" << row.says
        << "' in: " << outcome.text;
  }
}

// The names of the flags that bin/ defines.
std::vector<std::string> FlagsOf(const std::string& program) {
  Command command;
  command.program = program;
  command.folder = "/";
  command.arguments = {"--helpxml"};
  const std::string text = RunChild(command).text;
  const std::regex flag("<file>[^<]*/bin/[^<]*</file><name>([^<]*)</name>");
  std::vector<std::string> names;
  for (std::sregex_iterator at(text.begin(), text.end(), flag), end; at != end;
       ++at) {
    names.push_back((*at)[1]);
  }
  EXPECT_FALSE(names.empty()) << text;
  return names;
}

TEST(CommandLineAttack, GarbageForAnyFlagIsRefusedOrHarmless) {
  std::vector<std::pair<const SmallRun*, std::string>> flags;
  for (const SmallRun& run : SmallRuns()) {
    for (const std::string& flag : FlagsOf(run.program)) {
      flags.emplace_back(&run, flag);
    }
  }
  Attack([&](Dice* dice) {
    const auto& [run, flag] = dice->Pick(flags);
    const TemporaryFolder folder;
    Command command;
    command.program = run->program;
    command.folder = folder / "";
    if (!run->input.empty()) {
      WriteNistFile(folder / run->input);
    }
    command.arguments = run->arguments;
    const std::string& value = dice->Pick(GarbageValues());
    command.arguments.push_back(fmt::format("--{}={}", flag, value));
    // The message names the flag, or the file that the value names.
    RunOrRefuse(command, {flag, value.empty() ? flag : value.substr(0, 20)});
  });
}

}  // namespace command_line_test
}  // namespace invgrad
