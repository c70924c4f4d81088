// The scripts that measure the result pages: campaign.py runs the commands that
// a page shows, and tables.py fills tables from runs of these commands only.

#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/docs/pages.h"
#include "tests/docs/recorder.h"
#include "tests/docs/snippets.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace campaign_test {

namespace fs = std::filesystem;

class CampaignTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (RunInShell("command -v python3 > /dev/null") != 0) {
      GTEST_SKIP() << "no python3";
    }
  }

  int RunScript(const std::string& script, const std::string& arguments) {
    return RunInShell("cd " + Quoted(folder_ / "") + " && python3 " +
                      Quoted(Results() / script) + " " + arguments + " > " +
                      Quoted(Output()) + " 2>&1");
  }

  static fs::path Results() { return SourceRoot() / "docs/results"; }
  std::string Output() const { return folder_ / "output.txt"; }

  const TemporaryFolder folder_;
};

std::vector<Snippet> Blocks(const fs::path& page) {
  std::vector<Snippet> blocks;
  for (const Snippet& snippet : PageSnippets(ReadText(page))) {
    if (snippet.needs_path) blocks.push_back(snippet);
  }
  return blocks;
}

TEST_F(CampaignTest, RunsTheBlocksOfEveryPage) {
  std::set<fs::path> pages;
  for (const auto& entry : fs::directory_iterator(Results())) {
    if (entry.path().extension() == ".md") pages.insert(entry.path());
  }
  std::string expected;
  for (const fs::path& page : pages) {
    int number = 0;
    for (const Snippet& block : Blocks(page)) {
      expected += "# " + page.filename().string() + ", block " +
                  std::to_string(++number) + "\n" + block.text;
    }
  }
  ASSERT_EQ(RunScript("campaign.py", "--list"), 0) << ReadText(Output());
  EXPECT_EQ(ReadText(Output()), expected);
}

TEST_F(CampaignTest, TablesComeFromRunsOfTheirPage) {
  ASSERT_EQ(RunScript("tables.py", ". --list"), 0) << ReadText(Output());
  std::map<std::string, std::set<std::string>> runs;
  std::istringstream lines(ReadText(Output()));
  for (std::string page, run; lines >> page >> run;) runs[page].insert(run);
  EXPECT_GE(runs.size(), 9u);
  const Recorder recorder;
  for (const auto& [page, names] : runs) {
    std::set<std::string> outputs;
    for (const Snippet& block : Blocks(Results() / page)) {
      std::vector<Words> commands;
      std::string error;
      ASSERT_TRUE(recorder.Expand(block, &commands, &error)) << error;
      for (const Words& command : commands) {
        for (const std::string& word : command) {
          if (StartsWith(word, "--output=")) outputs.insert(word.substr(9));
        }
      }
    }
    for (const std::string& name : names) {
      EXPECT_EQ(outputs.count(name), 1u) << page << ": " << name;
    }
  }
}

}  // namespace campaign_test
}  // namespace invgrad
