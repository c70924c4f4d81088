// The program compare on least-squares problems: any ceres::Problem.

#include <sstream>
#include <string>
#include <vector>

#include "bin/estimate/least_squares_estimation.h"
#include "bin/estimate/way.h"
#include "gtest/gtest.h"
#include "invgrad/compare/compare.h"
#include "invgrad/method.h"
#include "tests/programs/compare_program.h"
#include "tests/programs/csv_lines.h"

namespace invgrad {
namespace least_squares_program_test {

class LeastSquaresProgram : public CompareProgram {
 protected:
  Output RunOn(const std::string& function,
               const std::string& output,
               std::vector<std::string> flags) const {
    flags.push_back("--problem=more_garbow_hillstrom:function=" + function);
    flags.push_back("--output=" + Path(output));
    flags.push_back("--noplots");
    flags.push_back("--noprogress");
    return Run(flags);
  }

  CsvLines Results(const std::string& output) const {
    return ReadCsv(ReadAll(Path(output) + "/results.csv"));
  }
};

TEST_F(LeastSquaresProgram, SolversAndRulesReachThePublishedMinimum) {
  const Output output =
      RunOn("bard",
            "run",
            {"--rules=ceres_lm,ceres_dogleg,gauss_newton:step_size=auto,"
             "ceres_lm+half_inverse",
             "--levels=1,1e-6"});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"s to 1", "|gradient|", "evaluations", "solved"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 4u);
  for (const auto& row : rows) {
    SCOPED_TRACE(row.at("method"));
    // Six published digits of the sum of squares, 8.21487e-3.
    EXPECT_NEAR(std::stod(row.at("final_cost")), 4.107435e-3, 5e-9);
    EXPECT_LT(std::stod(row.at("gradient_norm")), 1e-6);
    EXPECT_GT(std::stoi(row.at("evaluations")),
              std::stoi(row.at("iterations")));
    EXPECT_LE(std::stod(row.at("seconds_to_1")),
              std::stod(row.at("seconds_to_1e-06")));
    EXPECT_LE(std::stod(row.at("seconds_to_1e-06")),
              std::stod(row.at("seconds")));
  }
  // With proposals the solve without them is counted, too.
  EXPECT_GT(std::stoi(rows[3].at("evaluations")),
            std::stoi(rows[0].at("evaluations")));
}

// Of a problem of one's own: misspelt, or not for dogleg.
TEST(LeastSquaresEstimation, AMethodWithoutItsLinearSolverIsRefused) {
  PhysicsProblem problem;
  std::string error;
  ASSERT_TRUE(CreateProblem("more_garbow_hillstrom", nullptr, &problem, &error))
      << error;
  const auto refusal = [&](const std::string& method,
                           const std::string& linear_solver) {
    Way way;
    EXPECT_TRUE(ParseMethod(method, &way.method, &error)) << error;
    way.method.AddCeresDefaults({{"linear_solver", linear_solver}});
    const auto estimation = MakeLeastSquaresEstimation(
        *problem.least_squares, MinimizerOptions(), {1}, &error);
    estimation->SetStart(0);
    const auto solved = estimation->MakeProblem([] { return nullptr; });
    MinimizerSummary summary;
    std::string why;
    const bool has_run = MinimizeByWay(way,
                                       MinimizerOptions(),
                                       estimation.get(),
                                       solved.get(),
                                       &summary,
                                       &why);
    EXPECT_EQ(has_run, why.empty()) << why;
    return why;
  };
  EXPECT_EQ(refusal("ceres_lm", "dens_qr").rfind("linear_solver=dens_qr", 0),
            0u);
  EXPECT_EQ(refusal("ceres_dogleg", "cgnr").rfind("linear_solver=cgnr", 0), 0u);
  EXPECT_EQ(refusal("ceres_lm", "cgnr"), "");
}

TEST_F(LeastSquaresProgram, ASeedIsAStart) {
  const auto run = [this](const std::string& name) {
    const Output output = RunOn(
        "rosenbrock:spread=0.3", name, {"--seeds=1..3", "--rules=ceres_lm"});
    EXPECT_EQ(output.exit_code, 0) << output.text;
    return Results(name);
  };
  const auto first = run("first"), second = run("second");
  ASSERT_EQ(first.size(), 3u);
  ASSERT_EQ(second.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(first[i].at("start"),
              "more_garbow_hillstrom-seed" + std::to_string(i + 1));
    for (const char* column : {"initial_cost", "final_cost", "evaluations"}) {
      EXPECT_EQ(first[i].at(column), second[i].at(column)) << column;
    }
    EXPECT_NE(first[i].at("initial_cost"),
              first[(i + 1) % 3].at("initial_cost"));
    // The result is (1, 1).
    std::istringstream result(
        ReadAll(Path("first") + "/" + first[i].at("start") + "/ceres_lm.txt"));
    double x = 0.0, y = 0.0;
    ASSERT_TRUE(result >> x >> y);
    EXPECT_NEAR(x, 1.0, 1e-6);
    EXPECT_NEAR(y, 1.0, 1e-6);
  }
}

TEST_F(LeastSquaresProgram, ABudgetEndsARunUnsolved) {
  const Output output =
      RunOn("rosenbrock", "run", {"--steps=2", "--rules=ceres_lm"});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"0 of 1", "no", "not converged"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].at("iterations"), "2");
  EXPECT_EQ(rows[0].at("seconds_to_1e-05"), "");  // never
}

TEST_F(LeastSquaresProgram, WithoutRulesItTakesSomeThatSuit) {
  const Output output = RunOn("beale", "run", {});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_GE(Results("run").size(), 4u);
  EXPECT_NE(ReadAll(Path("run") + "/flags.txt").find("--rules=ceres_lm,"),
            std::string::npos);
}

TEST_F(LeastSquaresProgram, RefusesWhatNeedsANetwork) {
  for (const char* flag : {"--epochs=3",
                           "--batch_size=8",
                           "--hidden=3",
                           "--shuffle",
                           "--cpu_time"}) {
    SCOPED_TRACE(flag);
    const Output output = RunOn("rosenbrock", "refused", {flag});
    EXPECT_EQ(output.exit_code, 1);
    ExpectSays(output, {"needs a problem with a network"});
  }
  // A method that does is a row.
  const Output output =
      RunOn("rosenbrock", "run", {"--rules=ceres_lm,adam:batch_size=2,sip"});
  EXPECT_EQ(output.exit_code, 2) << output.text;
  ExpectSays(output, {"not run: "});
}

}  // namespace least_squares_program_test
}  // namespace invgrad
