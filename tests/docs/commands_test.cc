// Every command of the documentation runs as it stands. The commands of each
// page (blocks marked ```sh, and spans such as `compare --list`) and the sample
// runs at the top of each program are expanded by bash, with recorders in place
// of the programs; what was recorded then runs with the smallest budget. So a
// flag, a name or a file that has gone, a missing backslash, and a ">" or "|"
// without quotes fail here.
//
// What installs or builds (cmake, c++, sudo) is expanded, and does not run.

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/torch/torch_networks.h"
#include "tests/docs/pages.h"
#include "tests/docs/recorder.h"
#include "tests/docs/smallest_budget.h"
#include "tests/docs/snippets.h"
#include "tests/support/mpirun.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace commands_test {

namespace fs = std::filesystem;

// Programs and problems that are built with libtorch only.
bool NeedsTorch(const Words& command) {
  return std::any_of(command.begin(), command.end(), [](const auto& word) {
    return word.find("torch") != std::string::npos ||
           word.find("network=u_net") != std::string::npos;
  });
}

// The program whose flags a command has; empty for a script or a tool without
// one, and for what other tests run as it stands.
std::string ProgramOf(const Words& command) {
  const std::string& name = command[0];
  // The comparison hands its flags on.
  if (name == "run_comparison.sh" && command.size() > 1) return "compare";
  const bool runs = Programs().count(name) > 0 &&
                    !StartsWith(name, "example_") &&
                    name != "solve_output_layer";
  return runs ? name : "";
}

class CommandsTest : public ::testing::TestWithParam<std::string> {
 protected:
  CommandsTest() : files_(folder_ / "") {
    fs::create_directories(folder_ / "docs/tutorials");
  }

  // In a folder of its own, in which the flag file of an earlier command of the
  // page is found.
  // `launcher`: what stands before the program.
  void RunSmall(const std::string& launcher, const Words& command) {
    std::string line = "cd " + Quoted(folder_ / "") + " && " + launcher +
                       Quoted(BinDir() + "/" + command[0]);
    for (size_t i = 1; i < command.size(); ++i) {
      line += " " + Quoted(command[i]);
    }
    const std::string output = folder_ / "output";
    EXPECT_EQ(RunInShell(line + " > " + Quoted(output) + " 2>&1"), 0)
        << line << "\n"
        << ReadText(output);
  }

  // The commands of a page leave their results in places of their own; what
  // stands alone may use one again.
  void Check(const Words& recorded, bool may_overwrite) {
    if (!HasTorch() && NeedsTorch(recorded)) return;
    Words command = recorded;
    std::string launcher;
    if (command[0] == "mpirun") {
      if (!PrepareMpirun()) return;
      ASSERT_GT(command.size(), 3u);
      ASSERT_EQ(command[1], "-n");
      launcher = "mpirun -n " + Quoted(command[2]) + " ";
      command.erase(command.begin(), command.begin() + 3);
      command[0] = fs::path(command[0]).filename();
      if (command[0] == "bench") launcher = "";  // with --benchmark_list_tests
    }
    const fs::path script = SourceRoot() / "bin" / command[0];
    if (fs::is_regular_file(script)) {
      EXPECT_NE(fs::status(script).permissions() & fs::perms::owner_exec,
                fs::perms::none)
          << script;
    }
    command[0] = ProgramOf(command);
    if (command[0].empty()) return;
    command = Small(command, files_);
    if (may_overwrite && HasOutput(command[0]))
      command.push_back("--overwrite");
    RunSmall(launcher, command);
  }

  const TemporaryFolder folder_;
  const SmallFiles files_;
  const Recorder recorder_;
};

// README.md, the pages of docs, and the programs.
std::vector<std::string> Sources() {
  std::vector<std::string> sources;
  for (const fs::path& page : Pages()) {
    sources.push_back(fs::relative(page, SourceRoot()).string());
  }
  for (const auto& entry : fs::directory_iterator(SourceRoot() / "bin")) {
    if (entry.path().extension() == ".cc") {
      sources.push_back("bin/" + entry.path().filename().string());
    }
  }
  std::sort(sources.begin(), sources.end());
  return sources;
}

std::vector<Snippet> Snippets(const std::string& source) {
  const std::string text = ReadText(SourceRoot() / source);
  return StartsWith(source, "bin/") ? SampleRuns(text) : PageSnippets(text);
}

TEST_P(CommandsTest, RunAsTheyStand) {
  const std::vector<Snippet> snippets = Snippets(GetParam());
  EXPECT_FALSE(StartsWith(GetParam(), "bin/") && snippets.empty());
  for (const Snippet& snippet : snippets) {
    SCOPED_TRACE(snippet.text);
    std::vector<Words> commands;
    std::string error;
    EXPECT_TRUE(recorder_.Expand(snippet, &commands, &error)) << error;
    EXPECT_FALSE(commands.empty());
    for (const Words& command : commands) Check(command, !snippet.needs_path);
  }
}

INSTANTIATE_TEST_SUITE_P(Docs,
                         CommandsTest,
                         ::testing::ValuesIn(Sources()),
                         [](const ::testing::TestParamInfo<std::string>& info) {
                           return std::regex_replace(
                               info.param, std::regex("[^A-Za-z0-9]"), "_");
                         });

// Neither the choice of what runs nor the extraction can lose them in silence.
TEST(Commands, OfAllProgramsRun) {
  for (const std::string& program : Programs()) {
    const bool runs_elsewhere =
        StartsWith(program, "example_") || program == "solve_output_layer";
    EXPECT_EQ(ProgramOf({program}), runs_elsewhere ? "" : program);
  }
  EXPECT_EQ(ProgramOf({"run_comparison.sh", "--seeds=1"}), "compare");
  EXPECT_EQ(ProgramOf({"run_comparison.sh"}), "");
  EXPECT_EQ(ProgramOf({"cmake"}), "");
}

TEST(Commands, AreFound) {
  int num_snippets = 0;
  for (const std::string& source : Sources()) {
    num_snippets += static_cast<int>(Snippets(source).size());
  }
  EXPECT_GT(num_snippets, 80);
}

TEST(Commands, ContinuedLinesEndWithABackslash) {
  for (const fs::path& page : Pages()) {
    for (const Snippet& snippet : PageSnippets(ReadText(page))) {
      char above = 0;  // the last character of the line above
      for (const std::string& line : SplitLines(snippet.text)) {
        const std::string text =
            line.substr(std::min(line.find_first_not_of(' '), line.size()));
        if (StartsWith(text, "--")) {
          EXPECT_EQ(above, '\\') << page << line;
        }
        EXPECT_EQ(text.find("..."), std::string::npos) << page << line;
        above = line.empty() ? 0 : line.back();
      }
    }
  }
}

// --- The tests' own parts ---

TEST(Commands, SnippetsOfAPage) {
  const std::vector<Snippet> snippets = PageSnippets(
      "Try `compare\n--list`, `--rules=a`, `compare` or `other --list`.\n"
      "```sh\nbuild/release/bin/compare \\\n    --list\n```\n```\ntext\n```\n");
  ASSERT_EQ(snippets.size(), 2u);
  EXPECT_EQ(snippets[0].text, "build/release/bin/compare \\\n    --list\n");
  EXPECT_TRUE(snippets[0].needs_path);
  EXPECT_EQ(snippets[1].text, "compare --list\n");
  EXPECT_FALSE(snippets[1].needs_path);
}

TEST(Commands, SampleRunsAreTheFirstParagraph) {
  const std::string runs =
      "Sample runs:\n\n  a --b \\\n    --c\n  d\n\n  e  f\n";
  std::vector<Snippet> snippets = SampleRuns("/*\nDoes x.\n\n" + runs + "*/\n");
  ASSERT_EQ(snippets.size(), 1u);
  EXPECT_EQ(snippets[0].text, "  a --b \\\n    --c\n  d\n");
  snippets = SampleRuns("// Sample runs:\n//\n//   a --b\n//\n// Writes\n");
  ASSERT_EQ(snippets.size(), 1u);
  EXPECT_EQ(snippets[0].text, "   a --b\n");
  EXPECT_TRUE(SampleRuns("// Does x.\n//\n//   a --b\n").empty());
}

TEST(Commands, BashExpandsQuotesAndVariables) {
  std::vector<Words> commands;
  std::string error;
  ASSERT_TRUE(Recorder().Expand(
      {"G=\"a>b|c;d\"\nbuild/release/bin/sweep --grid=\"$G\" \\\n    --x\n"
       "cmake -S . && bin/run_tests.sh\n",
       true},
      &commands,
      &error))
      << error;
  EXPECT_EQ(commands,
            (std::vector<Words>{{"sweep", "--grid=a>b|c;d", "--x"},
                                {"cmake", "-S", "."},
                                {"run_tests.sh"}}));
}

TEST(Commands, WhatCannotBePastedFails) {
  for (const char* text : {
           "build/release/bin/compare\n    --rules=adam\n",
           "build/release/bin/compare --rules=adam:epochs=1>half_inverse\n",
           "build/release/bin/sweep --grid=rule=adam:step_size=1e-3|3e-3\n",
           "build/release/bin/sweep --grid=xi=1;phi=0 --plots=false\n",
           "build/release/bin/sweep --grid=\"$G\"\n",
           "build/release/bin/no_such_program\n",
           "compare --list\n",
       }) {
    std::vector<Words> commands;
    std::string error;
    EXPECT_FALSE(Recorder().Expand({text, true}, &commands, &error)) << text;
    EXPECT_NE(error, "") << text;
  }
}

TEST(Commands, OneCellKeepsTheRules) {
  EXPECT_EQ(OneCell("xi=1,8;rule=a:b=1|2:c=3,d>e:b=4|5;seed=1,2"),
            "xi=1;rule=a:b=1:c=3,d>e:b=4;seed=1");
  EXPECT_EQ(WithSmallBatches("batch_size=4;rule=a:batch_size=256,b"),
            "batch_size=2;rule=a:batch_size=8,b");
  EXPECT_EQ(WithSmallBatches("batch_size=0"), "batch_size=0");
  EXPECT_EQ(SmallProblem("poisson:num_samples=1024:resolution=4"),
            "poisson:resolution=4:num_samples=10");
  EXPECT_EQ(SmallProblem("sine_point"), "sine_point");
}

}  // namespace commands_test
}  // namespace invgrad
