// The program estimate, run as a user runs it.

#include "tests/programs/estimate_program.h"

#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/nist_file.h"
#include "tests/support/json_page.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace estimate_program_test {

namespace fs = std::filesystem;

TEST_F(EstimateProgram, ListsFormatsModelsAndMethods) {
  const Output output = Run({"--list"});
  EXPECT_EQ(output.exit_code, 0);
  ExpectSays(output,
             {".g2o",
              ".txt.bz2",
              "Misra1a",
              "Bennett5",
              "exp(-b2 x)",
              "half_inverse",
              "ceres_dogleg",
              "linear_solver="});
}

TEST_F(EstimateProgram, FitsANistFileFromBothStarts) {
  const Output output =
      RunQuietly(WriteMisra1a(),
                 "run",
                 {"--methods=ceres_lm,ceres_bfgs,gauss_newton,"
                  "ceres_lm+half_inverse:step_size=auto"});
  ExpectSays(output,
             {"y = b1 (1 - exp(-b2 x))",
              "Misra1a-start2",
              "2 of 2",
              "proposed",
              "results in"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 8);
  for (const auto& row : rows) {
    SCOPED_TRACE(row[0] + " " + row[1]);
    EXPECT_LT(std::stod(row[3]), 1e-15);  // cost
    EXPECT_GT(std::stod(row[8]), 7.0);    // digits
  }
  NistData result;
  std::string error;
  const std::string folder = Path("run") + "/Misra1a-start1/";
  ASSERT_TRUE(ReadNistFile(folder + "ceres_lm.dat", &result, &error)) << error;
  EXPECT_NEAR(result.starts(0, 0), 2.0, 1e-7);
  EXPECT_NEAR(result.starts(1, 1), 0.5, 1e-7);
  EXPECT_EQ(result.certified, Eigen::Vector2d(2.0, 0.5));
  for (const char* file : {"flags.txt",
                           "versions.txt",
                           "table.txt",
                           "table.md",
                           "summary.txt",
                           "summary.md",
                           "Misra1a-start2/ceres_lm.csv"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + file)) << file;
  }
  // The cost before the first step, and after each.
  const std::string csv = ReadAll(folder + "ceres_lm.csv");
  EXPECT_EQ(csv.rfind("iteration,cost,seconds,accepted\n0,", 0), 0) << csv;
}

TEST_F(EstimateProgram, ReportsTheSameCostsAsTheMethodsThemselves) {
  // From b = (1.5, 0.6), by hand.
  double cost = 0.0;
  for (int i = 1; i <= 8; ++i) {
    const double x = 0.5 * i;
    const double r =
        2.0 * (1.0 - std::exp(-0.5 * x)) - 1.5 * (1.0 - std::exp(-0.6 * x));
    cost += 0.5 * r * r;
  }
  RunQuietly(WriteMisra1a(), "run", {"--start=1", "--methods=ceres_lm"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 1);
  EXPECT_NEAR(std::stod(rows[0][2]), cost, 1e-14);
  EXPECT_EQ(std::stoi(rows[0][4]),
            std::stoi(rows[0][5]) + std::stoi(rows[0][6]));
}

TEST_F(EstimateProgram, MinimizesOverTheNonlinearParameters) {
  const Output output = RunQuietly(
      WriteMisra1a(),
      "run",
      {"--separable=both", "--methods=ceres_lm,ceres_lm+half_inverse"});
  ExpectSays(output, {"ceres_lm separable", "ceres_lm+half_inverse separable"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 8);
  for (std::size_t i = 0; i < rows.size(); i += 2) {
    // b1 is at its best, and the start's b1 has no influence.
    EXPECT_EQ(rows[i + 1][1], rows[i][1] + " separable");
    EXPECT_LT(std::stod(rows[i + 1][2]), std::stod(rows[i][2]));
    EXPECT_LT(std::stod(rows[i + 1][3]), 1e-20);
    EXPECT_GT(std::stod(rows[i + 1][8]), 9.0);
  }
  NistData result;
  std::string error;
  ASSERT_TRUE(ReadNistFile(
      Path("run") + "/Misra1a-start1/ceres_lm-separable.dat", &result, &error))
      << error;
  EXPECT_NEAR(result.starts(0, 0), 2.0, 1e-9);
  EXPECT_NEAR(result.starts(1, 0), 0.5, 1e-9);
}

TEST_F(EstimateProgram, RefusesAnUnknownWayToSeparate) {
  const Output output =
      RunQuietly(WriteMisra1a(), "run", {"--separable=yes"}, /*exit_code=*/1);
  ExpectSays(output, {"--separable=yes", "off", "on", "both"});
}

// Nothing is proved to be linear in a pose graph.
TEST_F(EstimateProgram, SaysWhereNothingIsLinear) {
  const Output output = RunQuietly(WriteG2o2d(),
                                   "run",
                                   {"--separable=both", "--methods=ceres_lm"},
                                   /*exit_code=*/2);
  ExpectSays(output, {"not run: no parameter is proved to be linear"});
  EXPECT_EQ(Results("run").size(), 2);
}

TEST_F(EstimateProgram, AdjustsBundlesPlainAndCompressed) {
  for (const std::string name : {"small.txt", "small.txt.bz2"}) {
    SCOPED_TRACE(name);
    RunQuietly(WriteBal(name),
               "run",
               {"--overwrite",
                "--methods=ceres_lm,ceres_dogleg,ceres_lm:linear_solver=cgnr"});
    const auto rows = Results("run");
    ASSERT_EQ(rows.size(), 3);
    for (const auto& row : rows) {
      EXPECT_LT(std::stod(row[3]), 0.1 * std::stod(row[2])) << row[1];
    }
    BalData result;
    std::string error;
    EXPECT_TRUE(
        ReadBalFile(Path("run") + "/small/ceres_dogleg.txt", &result, &error))
        << error;
    EXPECT_EQ(result.points.cols(), 5);
  }
}

TEST_F(EstimateProgram, OptimizesPoseGraphs) {
  const std::string input = WriteG2o2d() + "," + WriteG2o3d();
  RunQuietly(input, "run", {"--methods=ceres_lm,ceres_dogleg,gauss_newton"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 6);
  for (size_t i = 0; i < rows.size(); i += 3) {
    const double cost = std::stod(rows[i][3]);
    EXPECT_LT(cost, 0.5 * std::stod(rows[i][2]));
    for (size_t j = i + 1; j < i + 3; ++j) {
      EXPECT_NEAR(std::stod(rows[j][3]), cost, 1e-5 * cost) << rows[j][1];
    }
  }
  PoseGraph result;
  std::string error;
  ASSERT_TRUE(
      ReadG2oFile(Path("run") + "/triangle/ceres_lm.g2o", &result, &error))
      << error;
  EXPECT_EQ(result.poses.cols(), 3);
  EXPECT_EQ(result.edges.size(), 3);
  // The first pose stays. The information is not diagonal, so it matters whose
  // root it is.
  EXPECT_EQ(result.poses.col(0).norm(), 1.0);
  RunQuietly(WriteG2o3d(), "lower", {"--edge_error=ceres"});
  RunQuietly(WriteG2o3d(), "upper", {"--edge_error=ceres_upper"});
  const auto lower = Results("lower");
  const auto upper = Results("upper");
  EXPECT_NE(upper[0][2], lower[0][2]);
  EXPECT_NEAR(std::stod(upper[0][2]), std::stod(lower[0][2]), 0.1);
}

TEST_F(EstimateProgram, NoiseIsThatOfTheSeed) {
  const std::vector<std::string> arguments = {
      "--perturb=0.1", "--seeds=1,2", "--start=1", "--methods=ceres_lm"};
  RunQuietly(WriteMisra1a() + "," + WriteG2o2d(), "one", arguments);
  RunQuietly(WriteMisra1a() + "," + WriteG2o2d(), "two", arguments);
  const auto one = Results("one");
  const auto two = Results("two");
  ASSERT_EQ(one.size(), 4);
  ASSERT_EQ(two.size(), 4);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(one[i][2], two[i][2]);  // costs
    EXPECT_EQ(one[i][3], two[i][3]);
  }
  EXPECT_EQ(one[0][0], "Misra1a-start1-seed1");
  EXPECT_NE(one[0][2], one[1][2]);
  EXPECT_NE(one[2][2], one[3][2]);
  const std::string file = "/square-seed2/ceres_lm.g2o";
  EXPECT_EQ(ReadAll(Path("one") + file), ReadAll(Path("two") + file));
}

TEST_F(EstimateProgram, AMethodThatCannotTakeAProblemGetsARow) {
  const Output output =
      RunQuietly(WriteG2o2d(), "run", {"--methods=newton,ceres_lm"}, 2);
  ExpectSays(output, {"failed: ", "no exact Hessian", "converged"});
  // It has no cost, and no share in the least one.
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0][3], "nan");
  ExpectSays(output, {"0 of 1", "1 of 1"});
}

// Hundreds of steps of a quaternion's manifold, each with a rounding error.
TEST_F(EstimateProgram, WritesWhatManyStepsLeadTo) {
  const Output output = RunQuietly(
      WriteG2o3d(),
      "run",
      {"--methods=gradient_descent:step_size=1e-4", "--max_iterations=3000"});
  EXPECT_EQ(output.text.find("no result file"), std::string::npos)
      << output.text;
  int num_results = 0;
  for (const auto& entry : fs::directory_iterator(Path("run") + "/triangle")) {
    if (entry.path().extension() != ".g2o") continue;
    ++num_results;
    PoseGraph graph;
    std::string error;
    EXPECT_TRUE(ReadG2oFile(entry.path(), &graph, &error)) << error;
  }
  EXPECT_EQ(num_results, 1);
}

TEST_F(EstimateProgram, AResultThatCannotBeWrittenIsNoReasonToStop) {
  const Output output = RunQuietly(
      WriteMisra1a(), "run", {"--perturb=1e308", "--seeds=1,2,3"}, 3);
  ExpectSays(output, {"no result file: ", "a finite double", "results in"});
  EXPECT_FALSE(Results("run").empty());
}

TEST_F(EstimateProgram, TheExitCodeSaysThatNoStartWorked) {
  const Output output =
      RunQuietly(WriteMisra1a(), "run", {"--methods=adam:step_size=1e300"}, 3);
  ExpectSays(output, {"failed: ", "estimate: no run worked", "results in"});
  EXPECT_EQ(Results("run").size(), 2u);
}

TEST_F(EstimateProgram, FoldersAreReadForWhatTheirEndingsSay) {
  const fs::path folder = Path("folder");
  fs::create_directory(folder);
  fs::rename(WriteMisra1a(), folder / "Misra1a.dat");
  fs::rename(WriteText("notes.md", "# Notes\n"), folder / "notes.md");
  fs::create_symlink("loop.dat", folder / "loop.dat");
  fs::rename(WriteText("META.txt", "NIST's files, 2026\n"),
             folder / "META.txt");
  fs::rename(WriteText("empty.g2o", ""), folder / "empty.g2o");
  fs::rename(WriteText("table.dat", "1 2\n3 4\n"), folder / "table.dat");
  fs::rename(WriteBal("small.txt"), folder / "small.txt");
  fs::rename(WriteBal("packed.txt.bz2"), folder / "packed.txt.bz2");
  fs::rename(WriteText("square.g2o", "# a square\n" + ReadAll(WriteG2o2d())),
             folder / "square.g2o");
  const Output output =
      RunQuietly(folder.string(), "run", {"--max_iterations=2"});
  ExpectSays(output,
             {"Misra1a-start1",
              "META.txt is skipped: it does not begin as a file of its ext",
              "empty.g2o is skipped",
              "table.dat is skipped"});
  EXPECT_EQ(output.text.find("notes.md"), std::string::npos);
  // Misra1a from two starts, small, packed, square; by three methods.
  EXPECT_EQ(Results("run").size(), 15u);
  // A damaged file is no foreign one.
  const std::string text = ReadAll(folder / "small.txt");
  WriteText("folder/damaged.txt", text.substr(0, text.size() / 2));
  ExpectRefused({"--input=" + folder.string()},
                {"damaged.txt:", "the text ends"});
  fs::create_directory(Path("foreign"));
  WriteText("foreign/META.txt", "NIST's files\n");
  ExpectRefused({"--input=" + Path("foreign")},
                {"META.txt is skipped", "no file in " + Path("foreign")});
}

TEST_F(EstimateProgram, RobustLossesLowerTheCost) {
  RunQuietly(WriteG2o2d(), "none", {"--methods=ceres_lm"});
  RunQuietly(
      WriteG2o2d(), "huber", {"--methods=ceres_lm", "--loss=huber:0.01"});
  EXPECT_LT(std::stod(Results("huber")[0][2]),
            0.1 * std::stod(Results("none")[0][2]));
}

// The first step of every minimizer leads to b2 = -92, where exp(-b2 x)
// overflows: as in NIST's BoxBOD, but fitted exactly by its certified values.
TEST_F(EstimateProgram, NamesTheParameterThatLeavesTheDomain) {
  NistData data;
  data.name = "BoxBOD";
  data.predictors.resize(6, 1);
  data.predictors << 1.0, 2.0, 3.0, 5.0, 7.0, 10.0;
  data.responses = 200.0 * (1.0 - (-0.5 * data.predictors.array()).exp());
  data.starts = Eigen::Matrix2d::Ones();
  data.certified = Eigen::Vector2d(200.0, 0.5);
  data.standard_deviations = Eigen::Vector2d(1e-9, 1e-9);
  std::string error;
  ASSERT_TRUE(WriteNistFile(Path("BoxBOD.dat"), data, &error)) << error;
  const Output output = RunQuietly(
      Path("BoxBOD.dat"),
      "run",
      {"--start=1", "--methods=ceres_lm,ceres_lm+half_inverse:step_size=auto"});
  ExpectSays(output, {"outside the domain: residual block", "`b`[1] = -"});
  EXPECT_NE(ReadAll(Path("run") + "/results.csv").find("outside_domain"),
            std::string::npos);
  const nlohmann::json json = nlohmann::json::parse(
      ReadAll(Path("run") + "/BoxBOD-start1/ceres_lm.json"));
  EXPECT_GT(json["minimizer"]["num_outside_domain"], 0);
  const nlohmann::json& failure = json["minimizer"]["first_outside_domain"];
  EXPECT_EQ(failure["parameters"][0]["name"], "b");
  EXPECT_EQ(failure["parameters"][0]["component"], 1);
}

// The covariance of a chain without loops, by hand. Position and angle of an
// edge have the variances 1/10 and 1/100, and the errors of an angle turn all
// that follows. No edge leads to pose 4.
TEST_F(EstimateProgram, TheCovarianceOfAChainIsThatByHand) {
  constexpr int kNumEdges = 3;
  std::string text = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 4 1 1 1\n";
  for (int k = 1; k <= kNumEdges; ++k) {
    text += "VERTEX_SE2 " + std::to_string(k) + " " + std::to_string(k) +
            " 0 0\nEDGE_SE2 " + std::to_string(k - 1) + " " +
            std::to_string(k) + " 1 0 0 10 0 0 10 0 100\n";
  }
  const Output output =
      RunQuietly(WriteText("chain.g2o", text),
                 "run",
                 {"--methods=ceres_lm", "--covariance", "--overwrite"});
  ExpectSays(output, {"9 of 12"});
  const std::string path = Path("run") + "/chain/ceres_lm";
  const nlohmann::json json = nlohmann::json::parse(ReadAll(path + ".json"));
  std::set<std::string> found;
  ExpectOnPage(json, &found);
  ExpectAllFound("invgrad.estimate", found);
  for (const nlohmann::json& block : json["covariance"]["blocks"]) {
    const nlohmann::json& deviations = block["standard_deviations"];
    if (block["name"] == "pose 4") {
      EXPECT_TRUE(deviations[0].is_null());
      continue;
    }
    const int k = std::stoi(block["name"].get<std::string>().substr(5));
    double sum_of_squares = 0.0;
    for (int i = 1; i < k; ++i) sum_of_squares += i * i;
    EXPECT_NEAR(deviations[0], std::sqrt(k / 10.0), 1e-9);
    EXPECT_NEAR(
        deviations[1], std::sqrt(k / 10.0 + sum_of_squares / 100.0), 1e-9);
    EXPECT_NEAR(deviations[2], std::sqrt(k / 100.0), 1e-9);
  }
  const std::string report = ReadAll(path + ".report.txt");
  for (const char* part : {"`pose 3`[2]", "+/- 0.17321", "not determined"}) {
    EXPECT_NE(report.find(part), std::string::npos) << part << "\n" << report;
  }
}

TEST_F(EstimateProgram, WithoutCovarianceThereIsNone) {
  RunQuietly(WriteMisra1a(), "run", {"--methods=ceres_lm", "--start=1"});
  const std::string path = Path("run") + "/Misra1a-start1/ceres_lm";
  const nlohmann::json json = nlohmann::json::parse(ReadAll(path + ".json"));
  std::set<std::string> found;
  ExpectOnPage(json, &found);
  EXPECT_TRUE(json["covariance"].is_null());
  EXPECT_TRUE(json["rank_report"].is_null());
  EXPECT_FALSE(fs::exists(path + ".report.txt"));
}

TEST_F(EstimateProgram, DrawsPictures) {
  const Output output =
      Run({"--input=" + WriteMisra1a() + "," + WriteG2o2d() + "," +
               WriteG2o3d() + "," + WriteBal("small.txt"),
           "--start=1",
           "--methods=ceres_lm",
           "--covariance",
           "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  if (output.text.find("gnuplot") != std::string::npos) {
    GTEST_SKIP() << "needs gnuplot";
  }
  for (const char* name : {"Misra1a-start1", "square", "triangle", "small"}) {
    for (const char* picture : {"/result.png", "/cost.png"}) {
      EXPECT_TRUE(fs::exists(Path("run") + "/" + name + picture)) << name;
    }
    EXPECT_EQ(fs::exists(Path("run") + "/" + name + "/covariance.png"),
              name != std::string("small"));
  }
}

TEST_F(EstimateProgram, RefusesBadInput) {
  const std::string good = "--input=" + WriteMisra1a();
  ExpectRefused({}, {"--input", "files"});
  ExpectRefused({"--input=" + Path("missing.dat")},
                {"estimate: --input: ", "missing.dat"});
  ExpectRefused({"--input=" + WriteText("notes.xml", "1,2\n")},
                {"notes.xml", ".g2o (g2o)", "format"});
  ExpectRefused({"--input=" + WriteText("broken.g2o", "VERTEX_SE2 0 0 0\n")},
                {"broken.g2o:1"});
  ExpectRefused({"--input=" + WriteText("cut.txt", "2 3 6\n0 0 1.0")},
                {"cut.txt"});
  ExpectRefused({"--input=" + WriteMisra1a("Misra1x")},
                {"Misra1x.dat", "--list", "--model="});
  ExpectRefused({"--input=" + WriteMisra1a("Rat42")},
                {"Rat42.dat", "2 parameters", "expected 3"});
  // The same name twice would be the same folder of results.
  ExpectRefused({good + "," + Path("Misra1a.dat")}, {"two inputs", "Misra1a"});
  ExpectRefused({good + ",," + Path("missing.dat")}, {"empty item"});
  ExpectRefused({"--input=" + WriteText("alone.g2o", "VERTEX_SE2 0 0 0 0\n")},
                {"alone.g2o", "no edges"});
  ExpectRefused({"--input=" + WriteText("...g2o", ReadAll(WriteG2o2d()))},
                {"no name for its results"});
  std::string cut = ReadAll(Path("Misra1a.dat"));
  cut[cut.find_last_of("0123456789")] = '3';  // it was 4
  ExpectRefused({"--input=" + WriteText("cut.dat", cut)},
                {"cut.dat", "certified sum of squares", "cut off"});
  fs::create_directory(Path("empty"));
  ExpectRefused({"--input=" + Path("empty")}, {"no file in", "empty"});
}

TEST_F(EstimateProgram, RefusesBadFlags) {
  const std::string good = "--input=" + WriteMisra1a();
  ExpectRefused({good, "--methods=ceres_ml"}, {"ceres_ml", "ceres_lm"});
  ExpectRefused({good, "--methods=ceres_lm,adam:epochs=1>half_inverse"},
                {"--methods", "half_inverse", "phases"});
  ExpectRefused({good, "--methods=ceres_lm:linear_solver=qr"},
                {"linear_solver=qr", "sparse_schur"});
  ExpectRefused({good, "--format=xml"},
                {"--format=xml", "nist, csv, bal, g2o"});
  ExpectRefused({good, "--start=3"}, {"--start=3", "1, 2, both"});
  ExpectRefused({"--input=" + WriteG2o2d(), "--start=2"}, {"one start"});
  ExpectRefused({good, "--loss=hubert"}, {"--loss", "hubert", "huber"});
  ExpectRefused({good, "--perturb=-1"}, {"--perturb=-1", "0"});
  ExpectRefused({good, "--perturb=nan"}, {"--perturb=nan"});
  ExpectRefused({good, "--seeds=x"}, {"--seeds", "x"});
  ExpectRefused({good, "--max_iterations=-1"}, {"--max_iterations=-1"});
  ExpectRefused({good, "--seconds=-1"}, {"--seconds=-1"});
  ExpectRefused({good, "--function_tolerance=2"}, {"--function_tolerance=2"});
  ExpectRefused({good, "--threads=0"}, {"--threads=0", "[1, 256]"});
  ExpectRefused({good, "--edge_error=gtsam"}, {"g2o, ceres, ceres_upper"});
  ExpectRefused({good, "stray"}, {"stray"});
}

// Published and found by others.

TEST_F(EstimateProgram, SolvesThePublishedRegressions) {
  const std::string folder = PublishedData("nist");
  if (folder.empty()) {
    GTEST_SKIP() << "https://www.itl.nist.gov/div898/strd/nls has the files";
  }
  const Output output =
      RunQuietly(folder, "run", {"--methods=ceres_lm,ceres_bfgs"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 2 * 54);
  int num_solved[2] = {0, 0};
  double sum[2] = {0.0, 0.0};
  for (const auto& row : rows) {
    const int method = row[1] == "ceres_lm" ? 0 : 1;
    const double digits = std::stod(row[8]);
    if (digits > 4.0) {
      ++num_solved[method];
      sum[method] += digits;
    }
  }
  EXPECT_GE(num_solved[0], 53) << output.text;
  EXPECT_GE(num_solved[1], 52) << output.text;
  EXPECT_GE(sum[0] / num_solved[0], 9.0);
}

// NIST gives 11 digits. Lanczos1 is fitted to 13 digits, so that its residuals,
// and their variance, are rounding errors of the data.
TEST_F(EstimateProgram, ReproducesThePublishedStandardDeviations) {
  const std::string folder = PublishedData("nist");
  if (folder.empty()) {
    GTEST_SKIP() << "https://www.itl.nist.gov/div898/strd/nls has the files";
  }
  RunQuietly(
      folder, "run", {"--methods=ceres_lm", "--start=2", "--covariance"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 27);
  for (const auto& row : rows) {
    EXPECT_EQ(row[12], row[13]) << row[0];  // rank, parameters
    EXPECT_GE(std::stod(row[14]), row[0] == "Lanczos1-start2" ? 2.5 : 6.0)
        << row[0];
  }
}

TEST_F(EstimateProgram, AdjustsThePublishedBundle) {
  const std::string input = PublishedData("bal/problem-16-22106-pre.txt.bz2");
  if (input.empty()) {
    GTEST_SKIP() << "https://grail.cs.washington.edu/projects/bal has the file";
  }
  RunQuietly(input, "run", {"--methods=ceres_lm"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 1);
  EXPECT_NEAR(std::stod(rows[0][2]), 4.185660e6, 0.5);
  EXPECT_NEAR(std::stod(rows[0][3]), 1.803391e4, 0.05);
  EXPECT_GE(std::stoi(rows[0][4]), 5);
  EXPECT_LE(std::stoi(rows[0][4]), 7);
}

TEST_F(EstimateProgram, OptimizesThePublishedPoseGraphs) {
  const std::string plane = PublishedData("g2o/M3500.g2o");
  const std::string space = PublishedData("g2o/sphere2500.g2o");
  if (plane.empty() || space.empty()) {
    GTEST_SKIP() << "https://lucacarlone.mit.edu/datasets/ has the files";
  }
  RunQuietly(
      plane + "," + space, "run", {"--methods=ceres_lm", "--edge_error=ceres"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 2);
  EXPECT_NEAR(std::stod(rows[0][3]), 68.95648, 1e-4);
  EXPECT_NEAR(std::stod(rows[1][3]), 675.7562, 1e-3);
}

}  // namespace estimate_program_test
}  // namespace invgrad
