// compare on least-squares and point problems: what is done is not run again, and
// ranks share the runs.

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "tests/programs/compare_program.h"
#include "tests/programs/csv_lines.h"
#include "tests/support/mpirun.h"

namespace invgrad {
namespace minimization_resume_test {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

class MinimizationResume : public CompareProgram {
 protected:
  Words LeastSquares(const std::string& output, Words more = {}) const {
    Words words = {"--problem=more_garbow_hillstrom:function=bard:spread=0.3",
                   "--rules=ceres_lm,ceres_dogleg,half_inverse:step_size=auto",
                   "--seeds=1..2",
                   "--noplots",
                   "--noprogress",
                   "--output=" + Path(output)};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Words Point(const std::string& output, Words more = {}) const {
    Words words = {"--problem=squared_component",
                   "--rules=gradient_descent:step_size=0.01,newton,ceres_lm",
                   "--noplots",
                   "--noprogress",
                   "--output=" + Path(output)};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  // All that a run says of itself, its times among it: the same bytes are the
  // same run.
  std::string Summary(const std::string& output, const Words& files) const {
    std::string all;
    for (const std::string& file : files) {
      const std::string text = ReadAll(Path(output) + "/" + file);
      EXPECT_NE(text, "") << file;
      all += text;
    }
    return all;
  }

  CsvLines Results(const std::string& output) const {
    return ReadCsv(ReadAll(Path(output) + "/results.csv"));
  }
};

const Words kLeastSquaresFiles = {"results.csv", "table.txt", "summary.txt"};

TEST_F(MinimizationResume, DoneIsDoneForLeastSquares) {
  const Output first = Run(LeastSquares("run"));
  ASSERT_EQ(first.exit_code, 0) << first.text;
  const std::string before = Summary("run", kLeastSquaresFiles);
  EXPECT_EQ(Run(LeastSquares("run")).exit_code, 1);  // without --resume
  const Output again = Run(LeastSquares("run", {"--resume"}));
  EXPECT_EQ(again.exit_code, 0) << again.text;
  EXPECT_EQ(again.text, first.text);
  EXPECT_EQ(Summary("run", kLeastSquaresFiles), before);
}

TEST_F(MinimizationResume, OnlyWhatIsMissingRunsAgain) {
  ASSERT_EQ(Run(LeastSquares("run")).exit_code, 0);
  const CsvLines before = Results("run");
  const std::string folder =
      Path("run") + "/more_garbow_hillstrom-seed2/ceres_dogleg";
  ASSERT_TRUE(fs::remove(folder + ".run"));
  const Output resumed = Run(LeastSquares("run", {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  const CsvLines after = Results("run");
  ASSERT_EQ(after.size(), before.size());
  for (size_t i = 0; i < after.size(); ++i) {
    const bool is_again = after[i].at("method") == "ceres_dogleg" &&
                          after[i].at("start").back() == '2';
    for (const auto& [title, cell] : after[i]) {
      if (is_again && title.rfind("seconds", 0) == 0) continue;
      EXPECT_EQ(cell, before[i].at(title)) << title << i;
    }
    EXPECT_EQ(after[i].at("seconds") != before[i].at("seconds"), is_again);
  }
}

TEST_F(MinimizationResume, ALargerBudgetRunsWhatHadNotConverged) {
  ASSERT_EQ(Run(LeastSquares("run", {"--steps=4"})).exit_code, 0);
  const CsvLines before = Results("run");
  const Output resumed = Run(LeastSquares("run", {"--steps=100", "--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  const CsvLines after = Results("run");
  int num_more = 0;
  for (size_t i = 0; i < after.size(); ++i) {
    if (before[i].at("status").rfind("not converged", 0) == 0) {
      EXPECT_GT(std::stoi(after[i].at("iterations")), 4);
      ++num_more;
    } else {
      EXPECT_EQ(after[i], before[i]);
    }
  }
  EXPECT_GT(num_more, 0);
  const Output smaller = Run(LeastSquares("run", {"--steps=9", "--resume"}));
  EXPECT_EQ(smaller.exit_code, 1);
  ExpectSays(smaller, {"a smaller budget"});
}

// Without a budget a problem has its own, which is a number, too.
TEST_F(MinimizationResume, TheProblemsOwnBudgetIsANumber) {
  for (const bool is_point : {false, true}) {
    const auto run = [&](const Words& more) {
      return is_point ? Run(Point("point", more))
                      : Run(LeastSquares("least_squares", more));
    };
    ASSERT_EQ(run({}).exit_code, 0);
    const Output smaller = run({"--steps=9", "--resume"});
    EXPECT_EQ(smaller.exit_code, 1);
    ExpectSays(smaller, {"a smaller budget"});
    const Output same = run({"--resume"});
    EXPECT_EQ(same.exit_code, 0) << same.text;
    const Output larger = run({"--steps=100000", "--resume"});
    EXPECT_EQ(larger.exit_code, 0) << larger.text;
    EXPECT_EQ(run({"--resume"}).exit_code, 1);  // the own one is smaller
  }
}

TEST_F(MinimizationResume, ADamagedRunIsARowThatSaysSo) {
  ASSERT_EQ(Run(LeastSquares("run")).exit_code, 0);
  std::ofstream(Path("run") + "/more_garbow_hillstrom-seed1/ceres_lm.run",
                std::ios::app)
      << "x";
  const Output resumed = Run(LeastSquares("run", {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 2) << resumed.text;
  ExpectSays(resumed, {"not run: ", "ceres_lm.run", "damaged"});
}

TEST_F(MinimizationResume, CtrlCKeepsWhatIsDone) {
  Words words = LeastSquares("run", {"--steps=2000000000", "--seeds=1"});
  words[1] = "--rules=ceres_lm,gradient_descent:step_size=1e-9";
  const pid_t child = Start(words);
  const std::string folder = Path("run") + "/more_garbow_hillstrom-seed1/";
  WaitForFile(folder + "ceres_lm.run");
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(child, SIGINT);
  const Output interrupted = Wait(child);
  EXPECT_EQ(interrupted.exit_code, 128 + SIGINT) << interrupted.text;
  EXPECT_TRUE(fs::exists(folder + "ceres_lm.run"));
  EXPECT_FALSE(fs::exists(folder + "gradient_descent-step_size-1e-9.run"));
  const CsvLines rows = Results("run");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[1].at("status"), "interrupted");
}

const Words kPointFiles = {
    "table.txt", "path-newton.csv", "path-gradient_descent-step_size-0.01.csv"};

TEST_F(MinimizationResume, DoneIsDoneForPoints) {
  const Output first = Run(Point("run", {"--steps=7"}));
  ASSERT_EQ(first.exit_code, 0) << first.text;
  const std::string before = Summary("run", kPointFiles);
  const Output again = Run(Point("run", {"--steps=7", "--resume"}));
  EXPECT_EQ(again.text, first.text);
  EXPECT_EQ(Summary("run", kPointFiles), before);
  // Gradient descent goes from the start again, to where a longer run ends.
  const Output more = Run(Point("run", {"--steps=20", "--resume"}));
  EXPECT_EQ(more.exit_code, 0) << more.text;
  ASSERT_EQ(Run(Point("whole", {"--steps=20"})).exit_code, 0);
  EXPECT_EQ(Summary("run", {kPointFiles[2]}),
            Summary("whole", {kPointFiles[2]}));
}

class MinimizationRanks : public MinimizationResume {
 protected:
  void SetUp() override {
    if (!PrepareMpirun()) GTEST_SKIP() << kNoMpi;
  }
  Output RunRanks(int num_ranks, const Words& arguments) const {
    return Wait(StartCommand(
        MpirunCommand(num_ranks, BinDir() + "/compare", arguments)));
  }
};

TEST_F(MinimizationRanks, ShareTheRunsOfALeastSquaresProblem) {
  ASSERT_EQ(Run(LeastSquares("alone")).exit_code, 0);
  const Output together = RunRanks(2, LeastSquares("together"));
  ASSERT_EQ(together.exit_code, 0) << together.text;
  ExpectSays(together, {"results in"});
  const CsvLines a = Results("alone"), b = Results("together");
  ASSERT_EQ(b.size(), a.size());
  for (size_t i = 0; i < a.size(); ++i) {
    for (const auto& [title, cell] : a[i]) {
      if (title.rfind("seconds", 0) == 0) continue;
      EXPECT_EQ(b[i].at(title), cell) << title << i;
    }
  }
  // One process goes on with the run of two, and --overwrite knows all files.
  const std::string before = Summary("together", kLeastSquaresFiles);
  const Output resumed = Run(LeastSquares("together", {"--resume"}));
  EXPECT_EQ(resumed.exit_code, 0) << resumed.text;
  EXPECT_EQ(Summary("together", kLeastSquaresFiles), before);
  const Output over = Run(LeastSquares("together", {"--overwrite"}));
  EXPECT_EQ(over.exit_code, 0) << over.text;
}

TEST_F(MinimizationRanks, ShareTheMethodsOfAPointProblem) {
  ASSERT_EQ(Run(Point("alone")).exit_code, 0);
  const Output together = RunRanks(2, Point("together"));
  ASSERT_EQ(together.exit_code, 0) << together.text;
  EXPECT_EQ(Summary("together", {kPointFiles[1], kPointFiles[2]}),
            Summary("alone", {kPointFiles[1], kPointFiles[2]}));
}

}  // namespace minimization_resume_test
}  // namespace invgrad
