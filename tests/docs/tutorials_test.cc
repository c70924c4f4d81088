// The tutorials' programs do what their pages promise.

#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "docs/tutorials/shuttlecock_flight.h"
#include "gtest/gtest.h"
#include "invgrad/npy.h"
#include "tests/docs/pages.h"
#include "tests/support/source_tree.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace tutorials_test {

// Runs a tutorial's program with `arguments` in the folder of `output`; returns
// its exit code and what it printed.
std::pair<int, std::string> RunTutorial(const std::string& arguments,
                                        const std::string& output,
                                        const std::string& program) {
  const int status =
      std::system(("cd \"$(dirname '" + output + "')\" && '" + BinDir() + "/" +
                   program + "' " + arguments + " > '" + output + "' 2>&1")
                      .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, ReadText(output)};
}

// Draws the picture NAME.png of a tutorial in the folder, by NAME.gp.
void ExpectDrawn(const TemporaryFolder& folder, const std::string& name) {
  const std::string script =
      (SourceRoot() / "docs/tutorials" / (name + ".gp")).string();
  EXPECT_EQ(std::system(("cd '" + (folder / "") + "' && gnuplot '" + script +
                         "' > gnuplot.txt 2>&1")
                            .c_str()),
            0)
      << ReadText(folder / "gnuplot.txt");
  EXPECT_EQ(ReadText(folder / (name + ".png")).substr(1, 3), "PNG");
}

// Lines of a tutorial's file that are neither empty nor comments.
int NumCodeLines(const std::string& name) {
  int num_lines = 0;
  for (const std::string& line :
       SplitLines(ReadText(SourceRoot() / "docs/tutorials" / name))) {
    const size_t begin = line.find_first_not_of(' ');
    num_lines += begin != std::string::npos && line.substr(begin, 2) != "//";
  }
  return num_lines;
}

TEST(CompareTutorial, ComparesInNinetyLines) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--steps=2 --seeds=1,2 --noprogress --output='" +
                      (folder / "run") + "' --rules=half_inverse,ceres_lm",
                  folder / "out",
                  "compare_methods");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word : {"test loss", "half_inverse", "ceres_lm"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
  EXPECT_EQ(ReadText(folder / "run/loss.png").substr(1, 3), "PNG");
  Eigen::MatrixXd data;
  std::string error;
  EXPECT_TRUE(ReadNpy(folder / "run/data.npy", 1024, 2, &data, &error))
      << error;
  EXPECT_NE(RunTutorial("--list", folder / "list", "compare_methods")
                .second.find("shuttlecock\n"),
            std::string::npos);
  EXPECT_LE(
      NumCodeLines("shuttlecock_flight.h") + NumCodeLines("compare_methods.cc"),
      90);
}

TEST(TrainingTutorial, TrainsAndUsesItsNetworkInSixtyLines) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("", folder / "out", "train_through_simulator");
  EXPECT_EQ(exit_code, 0) << text;
  const size_t at = text.find("angle ");
  ASSERT_NE(at, std::string::npos) << text;
  EXPECT_NEAR(std::stod(text.substr(at + 6)), 0.7, 1e-5);
  EXPECT_LE(NumCodeLines("train_through_simulator.cc"), 60);
}

TEST(InverseTutorial, PrintsItsTableAndCountsInverses) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.02", folder / "out", "use_inverse_simulator");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word :
       {"miss [mm]", "dp_adam", "numerical inverse", "sip"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
}

TEST(ProposalsTutorial, ReportsOneSolveAndCountsTruths) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--starts=3", folder / "out", "propose_steps");
  EXPECT_EQ(exit_code, 0) << text;
  // The first start leads both solvers to a length of 1.503 m (truth: 1.5).
  for (const char* word : {"length 1.50",
                           " proposed, ",
                           "comparison: 16 iterations",
                           "nobody",
                           "initial_trust_region_radius = 1",
                           "control=gain",
                           " of 3"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
}

TEST(NetworkCostTutorial, SolvesWithAndWithoutTheInverse) {
  const TemporaryFolder folder;
  const auto run = [&](const std::string& argument) {
    const auto [exit_code, text] =
        RunTutorial(argument, folder / "out", "add_network_to_problem");
    EXPECT_EQ(exit_code, 0) << text;
    EXPECT_NE(text.find("Ceres Solver Report"), std::string::npos) << text;
    return text;
  };
  const std::string none = "\n0 proposed, ";
  EXPECT_EQ(run("").find(none), std::string::npos);
  EXPECT_NE(run("plain").find(none), std::string::npos);
}

TEST(ProposalsTutorial, RefusesUnknownRules) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--rules=half_invers", folder / "out", "propose_steps");
  EXPECT_EQ(exit_code, 1);
  EXPECT_NE(text.find("half_inverse"), std::string::npos) << text;
}

// With the choice between the two solvers; without it the page has three.
TEST(ProposalsTutorial, AddsThirteenLines) {
  const std::string source =
      ReadText(SourceRoot() / "docs/tutorials/propose_steps.cc");
  size_t num_lines = 0;
  for (const char* marker : {"includes", "added", "report"}) {
    num_lines += SplitLines(MarkedRegion(source, marker)).size();
  }
  EXPECT_EQ(num_lines, 13u);
}

TEST(RuleTutorial, UsesTheRuleByName) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("", folder / "out", "write_update_rule");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word : {"ceres_lm+shifted_inverse ",
                           "shifted_inverse:shift=1e-3 ",
                           "1.000  1.000  1.500  4.000",
                           "shifted_inverse  loss ",
                           "adam             loss ",
                           "unknown option 'shft'; did you mean shift?"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
}

TEST(RobotTutorial, CalibratesTrainsAndDrawsItsPicture) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.01 --folder='" + (folder / "") + "'",
                  folder / "out",
                  "train_robot_controller");
  EXPECT_EQ(exit_code, 0) << text;
  for (const char* word : {"calibrated: wheels 0.10",
                           "real miss [mm]",
                           "adam",
                           "half_inverse",
                           "ceres_lm"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
  ExpectDrawn(folder, "train_robot_controller");
}

// The checks depend on no budget.
TEST(FieldTutorial, ChecksItsDerivativesAndDrawsItsPicture) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--seconds=0.05 --folder='" + (folder / "") + "'",
                  folder / "out",
                  "write_field_simulator");
  EXPECT_EQ(exit_code, 0) << text;
  const auto number = [&text = text](const std::string& label) {
    const size_t at = text.find(label);
    EXPECT_NE(at, std::string::npos) << label << " in: " << text;
    return at == std::string::npos ? 1.0
                                   : std::stod(text.substr(at + label.size()));
  };
  EXPECT_LT(number("adjoint identity: "), 1e-12);
  EXPECT_LT(number("tangent, h = 1e-03: "), 1e-5);
  // Order 2.
  EXPECT_NEAR(std::log10(number("tangent, h = 1e-02: ") /
                         number("tangent, h = 1e-03: ")),
              2.0,
              0.35);
  for (const char* word :
       {"gradient_descent", "adam", "krylov", "hessian_free"}) {
    EXPECT_NE(text.find(word), std::string::npos) << word << " in: " << text;
  }
  ExpectDrawn(folder, "write_field_simulator");
}

TEST(EquationTutorial, SolvesAndDrawsInNinetyLines) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--steps=30", folder / "out", "solve_equation");
  EXPECT_EQ(exit_code, 0) << text;
  EXPECT_NE(text.find("after 30 steps; largest error"), std::string::npos)
      << text;
  ExpectDrawn(folder, "solve_equation");
  EXPECT_LE(NumCodeLines("solve_equation.cc"), 90);
}

// Eighty steps are enough for two digits.
TEST(CoefficientTutorial, FindsWhatTheMeasurementsTell) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--steps=80", folder / "out", "find_coefficient");
  EXPECT_EQ(exit_code, 0) << text;
  const size_t at = text.find("nu = ");
  const size_t best = text.find("closed form ");
  ASSERT_NE(at, std::string::npos) << text;
  ASSERT_NE(best, std::string::npos) << text;
  EXPECT_NEAR(
      std::stod(text.substr(at + 5)), std::stod(text.substr(best + 12)), 5e-4);
  // Why it ended.
  EXPECT_NE(text.find(" reached"), std::string::npos) << text;
}

// The corridor's axis stays at the odometry, 6 mm short; LM loses most of the
// 100 mm.
TEST(RegistrationTutorial, LeavesTheCorridorsAxisAlone) {
  const TemporaryFolder folder;
  const auto along = [&folder](const std::string& arguments) {
    const auto [exit_code, text] =
        RunTutorial(arguments, folder / "out", "register_without_drift");
    EXPECT_EQ(exit_code, 0) << text;
    std::vector<double> errors;
    for (const std::string& line : SplitLines(text)) {
      const size_t at = line.find(" along ");
      if (at != std::string::npos) {
        errors.push_back(std::stod(line.substr(at + 7)));
      }
    }
    EXPECT_EQ(errors.size(), 4u) << text;
    errors.resize(4);
    return std::make_pair(errors, text);
  };
  const auto [endless, text] = along("");
  EXPECT_EQ(endless[0], -6.0);
  EXPECT_LT(endless[1], -50.0);
  EXPECT_NEAR(endless[2], -6.0, 0.2);
  EXPECT_NEAR(endless[3], -6.0, 0.2);
  EXPECT_NE(text.find("1 of 6 left alone"), std::string::npos) << text;
  const auto [with_end, text_with_end] = along("--length=2");
  for (int i = 1; i < 4; ++i) EXPECT_LT(std::abs(with_end[i]), 6.0);
  EXPECT_NE(text_with_end.find("all 6 determined"), std::string::npos);
}

// Each line of the program's output is on its page, but for log messages, of
// Ceres and about the processor, and for lines that begin with one of `except`.
void ExpectOnPage(const std::string& tutorial,
                  const std::vector<std::string>& except,
                  int min_num_lines) {
  const TemporaryFolder folder;
  const auto [exit_code, text] = RunTutorial("", folder / "out", tutorial);
  EXPECT_EQ(exit_code, 0) << text;
  const std::vector<std::string> page = SplitLines(
      ReadText(SourceRoot() / "docs/tutorials" / (tutorial + ".md")));
  const auto is_log = [](const std::string& line) {
    return line.rfind("WARNING: Logging", 0) == 0 ||
           (line.size() > 9 && line[0] == 'W' &&
            line.find_first_not_of("0123456789", 1) == 9);
  };
  int num_lines = 0;
  for (const std::string& line : SplitLines(text)) {
    const bool is_excepted =
        std::any_of(except.begin(), except.end(), [&](const auto& start) {
          return line.rfind(start, 0) == 0;
        });
    if (is_excepted || is_log(line)) continue;
    EXPECT_GT(std::count(page.begin(), page.end(), line), 0) << line;
    ++num_lines;
  }
  EXPECT_GE(num_lines, min_num_lines);
}

// Line for line, but for motions: which of several that are as good is told
// may depend on rounding.
TEST(RankReportTutorial, PrintsWhatThePageShows) {
  ExpectOnPage("find_undetermined_parameters", {"===", "  +", "  -"}, 31);
}

// But for the JSON, with all digits.
TEST(CovarianceTutorial, PrintsWhatThePageShows) {
  ExpectOnPage("compute_covariance", {"{"}, 26);
}

TEST(SeparableFitTutorial, PrintsWhatThePageShows) {
  ExpectOnPage("eliminate_linear_parameters", {}, 10);
}

// But for the losses, whose digits depend on the processor.
TEST(ExactOutputLayerTutorial, PrintsWhatThePageShows) {
  ExpectOnPage(
      "solve_output_layer", {"  adam", "  levenberg", "  steps done"}, 4);
}

TEST(CompareTutorial, RefusesUnknownRules) {
  const TemporaryFolder folder;
  const auto [exit_code, text] =
      RunTutorial("--rules=half_invers", folder / "out", "compare_methods");
  EXPECT_EQ(exit_code, 1);
  EXPECT_NE(text.find("half_inverse"), std::string::npos) << text;
}

TEST(CompareTutorial, TakesDataOfTheRightShape) {
  const TemporaryFolder folder;
  std::string error;
  const Eigen::MatrixXd wrong = Eigen::MatrixXd::Ones(4, 3);
  ASSERT_TRUE(WriteNpy(folder / "wrong.npy", wrong, &error)) << error;
  const auto [exit_code, text] =
      RunTutorial("--data='" + (folder / "wrong.npy") + "'",
                  folder / "out",
                  "compare_methods");
  EXPECT_EQ(exit_code, 1);
  EXPECT_NE(text.find("(2 samples or more, 2), found (4, 3)"),
            std::string::npos)
      << text;
}

// Falling from rest, q_1 = -l log cosh(T sqrt(g / l)).
TEST(CompareTutorial, FallFromRestHasItsClosedForm) {
  const double x[] = {0.0, 0.0};
  double y[2];
  ASSERT_TRUE(Flight()(x, y));
  const double exact =
      -Flight::kDragLength *
      std::log(std::cosh(Flight::kTime *
                         std::sqrt(Flight::kGravity / Flight::kDragLength)));
  EXPECT_EQ(y[0], 0.0);
  // Order 4 with h = 0.02 s, in units of l / sqrt(g l) = 0.7 s: about
  // (0.02 / 0.7)^4 = 7e-7, and constants below one.
  EXPECT_NEAR(y[1], exact, 1e-6);
}

}  // namespace tutorials_test
}  // namespace invgrad
