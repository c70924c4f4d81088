// What compare leaves behind of a problem with too many unknowns to print.

#include <algorithm>
#include <filesystem>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/npy.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace heat_program_test {

class HeatProgram : public ProgramRunner {
 protected:
  HeatProgram() : ProgramRunner("compare") {}

  Eigen::VectorXd ReadState(const std::string& name, int size) const {
    Eigen::VectorXd x;
    std::string error;
    EXPECT_TRUE(ReadNpy(Path("run") + "/" + name, size, &x, &error)) << error;
    return x;
  }
};

TEST_F(HeatProgram, LargePointsLeaveNormsStatesAndPictures) {
  const Output output = Run({"--problem=heat_state:resolution=8",
                             "--rules=gradient_descent:step_size=1,ceres_bfgs",
                             "--steps=3",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"|x - x*|", "mean |x - x*|"});
  const std::string csv =
      ReadAll(Path("run") + "/path-gradient_descent-step_size-1.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')),
            "iteration,loss,x_norm,distance,seconds");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
  const Eigen::VectorXd truth = ReadState("x-true.npy", 64);
  const Eigen::VectorXd x = ReadState("x-gradient_descent-step_size-1.npy", 64);
  // The last row tells of the last state.
  const std::string last = csv.substr(csv.rfind('\n', csv.size() - 2) + 1);
  const size_t loss_end = last.find(',', last.find(',') + 1);
  const size_t norm_end = last.find(',', loss_end + 1);
  EXPECT_DOUBLE_EQ(std::stod(last.substr(loss_end + 1)), x.norm());
  EXPECT_DOUBLE_EQ(std::stod(last.substr(norm_end + 1)), (x - truth).norm());
  EXPECT_TRUE(std::filesystem::exists(Path("run") + "/fields.gp"));
}

// A row for the data, the initial weights and each method, the best one first; a
// column for y and x. The input is y*, and has no row.
TEST_F(HeatProgram, NetworksLeaveTheirFields) {
  const Output output = Run({"--problem=heat:resolution=4:num_samples=4",
                             "--rules=dp_adam,sip",
                             "--steps=1",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const std::string script = ReadAll(Path("run") + "/fields.gp");
  EXPECT_NE(script.find("panels = 8\ncolumns = 2\n"), std::string::npos);
  size_t end = 0;
  for (const char* title : {"y*",
                            "x*",
                            "initial weights, y",
                            "initial weights, x",
                            "sip, y",
                            "sip, x",
                            "dp_adam, y",
                            "dp_adam, x"}) {
    end = script.find("set title \"" + std::string(title) + '"', end);
    EXPECT_NE(end, std::string::npos) << title;
  }
}

// At the published strength of diffusion, one step of the damped inverse comes
// nearer to the true state than all steps of L-BFGS.
TEST_F(HeatProgram, OneStepOfTheInverseBeatsLbfgs) {
  const std::string problem = "--problem=heat_state:resolution=32";
  const auto distance = [&](const std::string& rule, int steps) {
    const Output output = Run({problem,
                               "--rules=" + rule,
                               "--steps=" + std::to_string(steps),
                               "--plots=false",
                               "--overwrite",
                               "--output=" + Path("run")});
    EXPECT_EQ(output.exit_code, 0) << output.text;
    return (ReadState("x-" + rule + ".npy", 1024) -
            ReadState("x-true.npy", 1024))
        .norm();
  };
  EXPECT_LT(distance("physical_gradient", 1),
            0.8 * distance("ceres_lbfgs", 200));
}

}  // namespace heat_program_test
}  // namespace invgrad
