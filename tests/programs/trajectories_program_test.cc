// The program trajectories, run as a user runs it.

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace trajectories_program_test {

namespace fs = std::filesystem;

class TrajectoriesProgram : public ProgramRunner {
 protected:
  TrajectoriesProgram() : ProgramRunner("trajectories") {}

  // The numbers of a CSV file without its header.
  static std::vector<std::vector<double>> ReadCsv(const std::string& path) {
    std::vector<std::vector<double>> rows;
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);
    while (std::getline(file, line)) {
      std::istringstream cells(line);
      rows.emplace_back();
      for (std::string cell; std::getline(cells, cell, ',');) {
        rows.back().push_back(std::stod(cell));
      }
    }
    return rows;
  }
};

TEST_F(TrajectoriesProgram, WritesPathsPicturesAndFlags) {
  const Output output = Run({"--steps=3",
                             "--rules=gradient_descent:step_size=0.01,ceres_lm",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  for (const char* name : {"gradient_descent-step_size-0.01.csv",
                           "ceres_lm.csv",
                           "trajectories.png",
                           "flags.txt",
                           "versions.txt"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
  // iteration, L, x, y at the start (3, 3), where y = (3, 9), and one step on:
  // x - 0.01 (6, 108).
  const auto rows = ReadCsv(Path("run/gradient_descent-step_size-0.01.csv"));
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0], (std::vector<double>{0, 90, 3, 3, 3, 9}));
  ASSERT_EQ(rows[1].size(), 6u);
  EXPECT_DOUBLE_EQ(rows[1][2], 2.94);
  EXPECT_DOUBLE_EQ(rows[1][3], 1.92);
}

// PBDL, physgrad-comparison: lengths of the first steps along the diagonal.
TEST_F(TrajectoriesProgram, PrintsThePublishedDiagonalLengths) {
  const Output output = Run({"--steps=10",
                             "--rules=gradient_descent:step_size=0.01,"
                             "newton:step_size=0.3333333333333333",
                             "--grid=11",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"1.053930", "1.264911"});
}

TEST_F(TrajectoriesProgram, AnExistingDirectoryIsReplacedOnlyIfAsked) {
  const std::vector<std::string> arguments = {
      "--steps=1", "--rules=adam", "--grid=5", "--output=" + Path("run")};
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const Output again = Run(arguments);
  EXPECT_EQ(again.exit_code, 1);
  ExpectSays(again, {Path("run"), "exists", "--overwrite"});
  // What the program cannot do it does not offer.
  EXPECT_EQ(again.text.find("--resume"), std::string::npos) << again.text;
  std::vector<std::string> overwrite = arguments;
  overwrite[1] = "--rules=newton";
  overwrite.push_back("--overwrite");
  EXPECT_EQ(Run(overwrite).exit_code, 0);
  EXPECT_FALSE(fs::exists(Path("run/adam.csv")));
  EXPECT_TRUE(fs::exists(Path("run/newton.csv")));
}

TEST_F(TrajectoriesProgram, RefusesBadInput) {
  ExpectRefused({"--rules=newtn"}, {"newtn", "newton"});
  ExpectRefused({"--problem=toy_network"}, {"toy_network", "two unknowns"});
  ExpectRefused({"--problem=squared_component:start_0=inf"}, {"start_0=inf"});
  ExpectRefused({"--steps=0"}, {"--steps=0", "allowed"});
  ExpectRefused({"--grid=1"}, {"--grid=1", "[2, 1000]"});
  ExpectRefused({"stray"}, {"stray"});
}

// One rule of many that leaves the numbers behind costs the others nothing.
TEST_F(TrajectoriesProgram, ADivergingRuleKeepsItsFirstSteps) {
  const Output output = Run({"--steps=20",
                             "--rules=gradient_descent:step_size=10,newton",
                             "--grid=5",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 2) << output.text;
  ExpectSays(output, {"failed"});
  EXPECT_GT(ReadCsv(Path("run/gradient_descent-step_size-10.csv")).size(), 2u);
  EXPECT_EQ(ReadCsv(Path("run/newton.csv")).size(), 21u);
}

TEST_F(TrajectoriesProgram, AStartWithoutAFiniteLossIsSaid) {
  const Output output = Run({"--problem=squared_component:start_1=1e200",
                             "--rules=newton,ceres_lm,ceres_bfgs",
                             "--grid=5",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 3) << output.text;
  ExpectSays(output,
             {"newton  (failed: no start", "ceres_lm  (failed: no start"});
}

// All cells of the map have their centers at the edges.
TEST_F(TrajectoriesProgram, ACoarseMapIsDrawn) {
  const Output output = Run(
      {"--steps=2", "--rules=newton", "--grid=2", "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(output.text.find("no picture"), std::string::npos) << output.text;
}

TEST_F(TrajectoriesProgram, AMethodThatDoesNotFitCostsTheOthersNothing) {
  const std::vector<std::string> arguments = {
      "--problem=linear_scale", "--steps=2", "--grid=5"};
  const auto run = [&](const std::string& rules, const std::string& name) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), {"--rules=" + rules, "--output=" + Path(name)});
    return Run(all);
  };
  const Output some = run("newton,ceres_lm", "some");
  EXPECT_EQ(some.exit_code, 2) << some.text;
  ExpectSays(some, {"ceres_lm  (not run: "});
  EXPECT_TRUE(fs::exists(Path("some/newton.csv")));
  EXPECT_TRUE(fs::exists(Path("some/trajectories.png")));
  const Output none = run("ceres_lm", "none");
  EXPECT_EQ(none.exit_code, 3) << none.text;
}

TEST_F(TrajectoriesProgram, AProblemWithoutAnOptimumHasPathsToo) {
  const Output output = Run({"--problem=linear_scale",
                             "--steps=2",
                             "--rules=gradient_descent:step_size=1e-4,newton",
                             "--grid=5",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_TRUE(fs::exists(Path("run/trajectories.png")));
}

}  // namespace trajectories_program_test
}  // namespace invgrad
