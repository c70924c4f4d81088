// The program estimate on registered least-squares problems.

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/estimation_table.h"
#include "gtest/gtest.h"
#include "tests/programs/csv_lines.h"
#include "tests/programs/estimate_program.h"

namespace invgrad {
namespace estimate_problems_test {

class EstimateProblems : public EstimateProgram {
 protected:
  Output RunOn(const std::string& problems,
               const std::string& output,
               std::vector<std::string> flags,
               int exit_code) const {
    flags.insert(flags.end(),
                 {"--problems=" + problems,
                  "--output=" + Path(output),
                  "--noplots",
                  "--noprogress"});
    Output result = Run(flags);
    EXPECT_EQ(result.exit_code, exit_code) << result.text;
    return result;
  }
};

const char kTwo[] =
    "more_garbow_hillstrom:function=bard:spread=0.3,"
    "more_garbow_hillstrom:function=beale:spread=0.3";

TEST_F(EstimateProblems, ComparesSeveralProblemsFromSeeds) {
  const Output output = RunOn(kTwo,
                              "run",
                              {"--seeds=1..3",
                               "--methods=ceres_lm,ceres_dogleg",
                               "--levels=1e-6",
                               "--covariance"},
                              0);
  ExpectSays(output,
             {"3 parameters in 1 blocks, 15 residuals",
              "3 of 3",
              "s to 1e-06",
              "rank"});
  const CsvLines rows = ReadCsv(ReadAll(Path("run") + "/results.csv"));
  ASSERT_EQ(rows.size(), 12u);
  std::set<std::string> starts;
  for (const auto& row : rows) {
    starts.insert(row.at("start"));
    EXPECT_EQ(row.at("rank"), row.at("parameters"));
  }
  EXPECT_EQ(starts.size(), 6u);
  EXPECT_EQ(*starts.begin(),
            "more_garbow_hillstrom-function-bard-spread-0.3-seed1");
  // Profiles over all starts.
  const std::string report = ReadAll(Path("run") + "/report.html");
  EXPECT_NE(report.find("performance profile"), std::string::npos);
}

using Counts = std::vector<std::pair<std::string, int>>;

EstimationRow RowOf(const std::string& start,
                    const std::string& method,
                    double initial_cost,
                    double final_cost) {
  EstimationRow row;
  row.start = start;
  row.method = method;
  row.initial_cost = initial_cost;
  row.final_cost = final_cost;
  return row;
}

// At a minimum of zero, costs are what rounding and the last step left.
TEST(LeastCostCounts, ACostOfZeroIsReachedUpToRounding) {
  EXPECT_EQ(LeastCostCounts({RowOf("1", "a", 24.0, 1e-31),
                             RowOf("1", "b", 24.0, 1e-18),
                             RowOf("2", "a", 24.0, 0.5),
                             RowOf("2", "b", 24.0, 0.0),
                             RowOf("3", "a", 24.0, 2.0),
                             RowOf("3", "b", 24.0, 2.0 + 1e-5)}),
            (Counts{{"a", 2}, {"b", 2}}));
}

// Rounding errors are not those of a start far away.
TEST(LeastCostCounts, ABadStartDoesNotMakeCostsEqual) {
  EXPECT_EQ(LeastCostCounts({RowOf("1", "a", 1e34, 1.0),
                             RowOf("1", "b", 1e34, 8.0),
                             RowOf("2", "a", 24.0, 1e-31),
                             RowOf("2", "b", 24.0, 1e-18)}),
            (Counts{{"a", 2}, {"b", 1}}));
  EstimationRow good = RowOf("1", "a", 1e34, 1.0);
  good.constant_cost = 24.0;
  EXPECT_EQ(LeastCostCounts({good, RowOf("1", "b", 1e34, 8.0)}),
            (Counts{{"a", 1}, {"b", 0}}));
}

TEST(LeastCostCounts, ACostThatIsNotFiniteDoesNotCount) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(LeastCostCounts({RowOf("1", "a", kInfinity, kInfinity),
                             RowOf("1", "b", kInfinity, std::nan("")),
                             RowOf("2", "a", kInfinity, kInfinity),
                             RowOf("2", "b", kInfinity, 1.0)}),
            (Counts{{"a", 0}, {"b", 1}}));
}

TEST(LocalMinimaTable, ABadStartDoesNotMakeMinimaEqual) {
  const Table table = LocalMinimaTable({RowOf("1", "a", 1e34, 0.25),
                                        RowOf("2", "a", 24.0, 0.5),
                                        RowOf("3", "a", 24.0, 0.5)});
  ASSERT_EQ(table.rows().size(), 3u);  // with the titles
  EXPECT_EQ(table.rows()[1].back(), "1");
  EXPECT_EQ(table.rows()[2].back(), "2");
}

TEST_F(EstimateProblems, GoesOnWithWhatIsMissing) {
  const std::vector<std::string> flags = {"--methods=ceres_lm", "--seeds=1..2"};
  const Output first = RunOn(kTwo, "run", flags, 0);
  std::vector<std::string> resumed = flags;
  resumed.emplace_back("--resume");
  const std::string before = ReadAll(Path("run") + "/results.csv");
  EXPECT_EQ(RunOn(kTwo, "run", resumed, 0).text, first.text);
  EXPECT_EQ(ReadAll(Path("run") + "/results.csv"), before);
  resumed.emplace_back("--overwrite");
  ExpectSays(RunOn(kTwo, "run", resumed, 1),
             {"--resume=true is not allowed with --overwrite"});
}

// A file's runs are read with their parameters: pictures, covariances and
// digits are those of the first call.
TEST_F(EstimateProblems, GoesOnWithFiles) {
  const std::string input = WriteMisra1a();
  const std::vector<std::string> flags = {
      "--methods=ceres_lm,ceres_lm+geodesic", "--covariance"};
  const Output first = RunQuietly(input, "run", flags);
  const std::string before = ReadAll(Path("run") + "/results.csv");
  std::vector<std::string> resumed = flags;
  resumed.emplace_back("--resume");
  EXPECT_EQ(RunQuietly(input, "run", resumed).text, first.text);
  EXPECT_EQ(ReadAll(Path("run") + "/results.csv"), before);
  // More than the input's own 10000.
  resumed.emplace_back("--max_iterations=20000");
  EXPECT_EQ(RunQuietly(input, "run", resumed).text, first.text);
  EXPECT_EQ(ReadAll(Path("run") + "/results.csv"), before);
}

TEST_F(EstimateProblems, RefusesFlagsOfFiles) {
  for (const char* flag : {"--perturb=0.1",
                           "--start=1",
                           "--loss=huber",
                           "--model=a*x",
                           "--bounds=a=0..1",
                           "--edge_error=ceres"}) {
    ExpectSays(RunOn(kTwo, "no", {flag}, 1),
               {flag, "is for files, not for --problems"});
  }
  const Output output = Run(
      {"--input=" + WriteMisra1a(), "--seeds=1..3", "--output=" + Path("no")});
  EXPECT_EQ(output.exit_code, 1) << output.text;
  ExpectSays(output, {"--seeds=1..3 needs --perturb or --problems"});
}

TEST_F(EstimateProblems, SaysWhatDoesNotFit) {
  ExpectSays(RunOn("squared_component", "no", {}, 1),
             {"--problems: squared_component is no least-squares problem"});
  ExpectSays(RunOn("more_garbow", "no", {}, 1), {"'more_garbow'"});
  ExpectSays(RunOn("more_garbow_hillstrom,more_garbow_hillstrom", "no", {}, 1),
             {"two inputs are called more_garbow_hillstrom"});
  ExpectSays(RunOn("", "no", {}, 1), {"--input is missing", "--problems"});
}

TEST_F(EstimateProblems, ListsThem) {
  ExpectSays(Run({"--list"}), {"--problems=name", "more_garbow_hillstrom"});
}

}  // namespace estimate_problems_test
}  // namespace invgrad
