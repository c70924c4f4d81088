// The program registration, run as a user runs it.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "bin/registration/methods.h"
#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace registration_program_test {

namespace fs = std::filesystem;

TEST(RegistrationMethods, AreReadWithTheirThresholds) {
  std::vector<RegistrationMethod> methods;
  std::string error;
  ASSERT_TRUE(ParseRegistrationMethods(
      "odometry,lm,half_inverse,gauss_newton,eigenvalue:2.5,determined",
      &methods,
      &error))
      << error;
  ASSERT_EQ(methods.size(), 6u);
  EXPECT_EQ(methods[3].eigenvalue, 0.0);
  EXPECT_EQ(methods[4].label, "eigenvalue:2.5");
  EXPECT_EQ(methods[4].eigenvalue, 2.5);
  using Kind = RegistrationMethod::Kind;
  for (const RegistrationMethod& method : methods) {
    const auto rule = MakeRegistrationRule(method, 0.1);
    EXPECT_EQ(rule == nullptr,
              method.kind == Kind::kOdometry || method.kind == Kind::kLm);
    const bool leaves_alone =
        method.kind == Kind::kEigenvalue || method.kind == Kind::kDetermined;
    EXPECT_EQ(NumLeftAlone(method, rule.get()), leaves_alone ? 0 : -1);
  }
  for (const char* bad : {"",
                          "LM",
                          "eigenvalue",
                          "eigenvalue:",
                          "eigenvalue:x",
                          "eigenvalue:-1",
                          "eigenvalue:nan",
                          "determined:0.1"}) {
    error.clear();
    EXPECT_FALSE(ParseRegistrationMethods(bad, &methods, &error)) << bad;
    EXPECT_FALSE(error.empty()) << bad;
  }
}

class RegistrationProgram : public ProgramRunner {
 protected:
  RegistrationProgram() : ProgramRunner("registration") {}

  // The last scan's cells of drift.csv by their titles, a row a path.
  std::vector<std::map<std::string, std::string>> LastScans(
      const std::string& run, const std::string& scan) const {
    std::istringstream lines(ReadAll(Path(run + "/drift.csv")));
    std::vector<std::string> titles;
    std::vector<std::map<std::string, std::string>> rows;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream cells(line);
      std::map<std::string, std::string> row;
      size_t i = 0;
      const bool is_header = titles.empty();
      for (std::string cell; std::getline(cells, cell, ','); ++i) {
        // RFC 4180 ends lines by CR LF.
        if (!cell.empty() && cell.back() == '\r') cell.pop_back();
        if (is_header) {
          titles.push_back(cell);
        } else {
          row[titles.at(i)] = cell;
        }
      }
      if (!is_header && row["scan"] == scan) rows.push_back(row);
    }
    return rows;
  }
};

TEST_F(RegistrationProgram, WritesTablePathsAndPictures) {
  const std::vector<std::string> arguments = {
      "--scenes=room,corridor",
      "--methods=odometry,lm,determined",
      "--scans=6",
      "--seeds=1,2"};
  const auto with_output = [&](const std::string& name) {
    std::vector<std::string> all = arguments;
    all.push_back("--output=" + Path(name));
    return all;
  };
  const Output output = Run(with_output("run"));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"corridor", "determined [cm]", "undetermined [mrad]"});
  for (const char* name : {"table.txt",
                           "table.md",
                           "drift.csv",
                           "trajectories.png",
                           "determined.png",
                           "undetermined.png",
                           "flags.txt",
                           "versions.txt"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
  const auto rows = LastScans("run", "6");
  ASSERT_EQ(rows.size(), 2u * 3u * 2u);
  for (const auto& row : rows) {
    const bool is_room = row.at("scene") == "room";
    const std::string& method = row.at("method");
    EXPECT_EQ(row.at("left_alone"),
              method != "determined" ? "-1"
              : is_room              ? "0"
                                     : "1");
    // Six alignments of 10 cm; the odometry has 5 mm.
    EXPECT_NEAR(
        std::stod(row.at("x_m")), 0.6, !is_room && method == "lm" ? 0.5 : 0.1);
    EXPECT_EQ(std::stod(row.at("undetermined_m")) == 0.0, is_room);
  }
  // Nothing but the seed is random.
  ASSERT_EQ(Run(with_output("again")).exit_code, 0);
  EXPECT_EQ(ReadAll(Path("run/drift.csv")), ReadAll(Path("again/drift.csv")));
}

// Edges and curvature remain, and are not taken for information.
TEST_F(RegistrationProgram, ExactScansDetermineNoMoreThanNoisyOnes) {
  const Output output = Run({"--scenes=room,corridor,tunnel,plane,cylinder",
                             "--methods=determined",
                             "--scans=5",
                             "--noise=0",
                             "--outliers=0",
                             "--plots=false",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const std::map<std::string, std::string> expected = {{"room", "0"},
                                                       {"corridor", "1"},
                                                       {"tunnel", "1"},
                                                       {"plane", "3"},
                                                       {"cylinder", "2"}};
  const auto rows = LastScans("run", "5");
  ASSERT_EQ(rows.size(), expected.size());
  for (const auto& row : rows) {
    EXPECT_EQ(row.at("left_alone"), expected.at(row.at("scene")))
        << row.at("scene");
  }
}

// The roll in a tube has an eigenvalue in m^2.
TEST_F(RegistrationProgram, TheUnitChangesAFixedThresholdOnly) {
  const Output output = Run({"--scenes=cylinder",
                             "--methods=determined,eigenvalue:100",
                             "--units=m,mm",
                             "--scans=5",
                             "--plots=false",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_FALSE(fs::exists(Path("run/trajectories.png")));
  const auto rows = LastScans("run", "5");
  ASSERT_EQ(rows.size(), 4u);
  for (const int i : {0, 1}) {
    EXPECT_EQ(rows[i].at("method"), "determined");
    EXPECT_EQ(rows[i].at("left_alone"), "2");
  }
  for (const char* value : {"determined_m",
                            "determined_rad",
                            "undetermined_m",
                            "undetermined_rad"}) {
    EXPECT_NEAR(
        std::stod(rows[0].at(value)), std::stod(rows[1].at(value)), 1e-9)
        << value;
  }
  EXPECT_EQ(rows[2].at("left_alone"), "2");
  EXPECT_EQ(rows[3].at("left_alone"), "1");
}

TEST_F(RegistrationProgram, AnExistingDirectoryIsReplacedOnlyIfAsked) {
  const std::vector<std::string> arguments = {"--scenes=plane",
                                              "--methods=odometry",
                                              "--scans=1",
                                              "--plots=false",
                                              "--output=" + Path("run")};
  ASSERT_EQ(Run(arguments).exit_code, 0);
  const Output again = Run(arguments);
  EXPECT_EQ(again.exit_code, 1);
  ExpectSays(again, {"exists", "--overwrite"});
  std::vector<std::string> overwrite = arguments;
  overwrite.push_back("--overwrite");
  EXPECT_EQ(Run(overwrite).exit_code, 0);
}

// All rays may be outliers: nothing is aligned well, and nothing fails.
TEST_F(RegistrationProgram, AcceptsScansWithoutASurface) {
  const Output output = Run({"--scenes=room",
                             "--methods=lm,determined",
                             "--scans=2",
                             "--outliers=1",
                             "--plots=false",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
}

TEST_F(RegistrationProgram, RefusesBadInput) {
  ExpectRefused({"--scenes=rom"},
                {"--scenes", "unknown scene 'rom'", "room, corridor"});
  ExpectRefused({"--scenes="}, {"--scenes", "expected a scene"});
  ExpectRefused({"--methods=determind"},
                {"--methods", "unknown method 'determind'", "eigenvalue"});
  ExpectRefused({"--methods=eigenvalue:-1"},
                {"'eigenvalue:-1'", "positive threshold"});
  ExpectRefused({"--units=cm"}, {"--units", "unknown unit 'cm'", "m, mm"});
  ExpectRefused({"--scans=0"}, {"--scans=0 is out of range"});
  ExpectRefused({"--noise=-0.5"}, {"--noise=-0.5 is out of range"});
  ExpectRefused({"--noise=nan"}, {"--noise=nan"});
  ExpectRefused({"--outliers=1.5"}, {"--outliers=1.5 is out of range"});
  ExpectRefused({"--tau=0.75"}, {"--tau=0.75 is out of range"});
  ExpectRefused({"--seeds=x"}, {"--seeds"});
  ExpectRefused({"stray"}, {"stray"});
}

TEST_F(RegistrationProgram, AlignsTheCylinderOfAPublishedComparison) {
  const std::vector<std::string> arguments = {
      "--cylinder",
      "--methods=odometry,gauss_newton,eigenvalue:120,determined",
      "--seeds=3"};
  std::vector<std::string> all = arguments;
  all.push_back("--output=" + Path("run"));
  const Output output = Run(all);
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"same: eigenvalues of the first H: ", "others", "yaw"});
  EXPECT_TRUE(fs::exists(Path("run/cylinder.md")));
  const std::string csv = ReadAll(Path("run/cylinder.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 3 * 4);
  all.back() = "--output=" + Path("again");
  ASSERT_EQ(Run(all).exit_code, 0);
  EXPECT_EQ(ReadAll(Path("again/cylinder.csv")), csv);
  const Output defaults =
      Run({"--cylinder", "--seeds=3", "--output=" + Path("defaults")});
  EXPECT_EQ(defaults.exit_code, 0) << defaults.text;
  ExpectSays(defaults, {"gauss_newton", "determined"});
  ExpectRefused({"--cylinder", "--methods=determined,lm"},
                {"--methods: the cylinder has no method 'lm'"});
  for (const char* flag : {"--scenes=room",
                           "--scans=3",
                           "--outliers=0.1",
                           "--guard_edges=false"}) {
    ExpectRefused({"--cylinder", "--methods=determined", flag},
                  {flag, "is not for --cylinder"});
  }
}

}  // namespace registration_program_test
}  // namespace invgrad
