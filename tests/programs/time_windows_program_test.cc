// The program time_windows, run as a user runs it.

#include <filesystem>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/npy.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace time_windows_program_test {

namespace fs = std::filesystem;

class TimeWindowsProgram : public ProgramRunner {
 protected:
  TimeWindowsProgram() : ProgramRunner("time_windows") {}
};

TEST_F(TimeWindowsProgram, WritesSolutionTableAndPicture) {
  const Output output =
      Run({"--problem=burgers_pinn:viscosity=0.1:num_t=8:num_x=12",
           "--windows=2",
           "--steps=60",
           "--hidden=10-10",
           "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"0 - 0.5", "0.5 - 1", "L2_error of all times"});
  for (const char* name : {"table.txt",
                           "weights-0.npy",
                           "weights-1.npy",
                           "solution.png",
                           "flags.txt"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
  Eigen::MatrixXd solution;
  std::string error;
  ASSERT_TRUE(ReadNpy(Path("run/solution.npy"), -1, 4, &solution, &error))
      << error;
  ASSERT_EQ(solution.rows(), 41 * 101);
  ASSERT_EQ(solution.cols(), 4);
  const double distance = (solution.col(2) - solution.col(3)).norm();
  EXPECT_LT(distance, 1e-2 * solution.col(3).norm());
  EXPECT_GT(distance, 0.0);
}

TEST_F(TimeWindowsProgram, NamesWhatIsNotAllowed) {
  const auto says = [this](const std::vector<std::string>& arguments,
                           const std::string& what) {
    std::vector<std::string> all = arguments;
    all.push_back("--output=" + Path("bad"));
    const Output output = Run(all);
    EXPECT_EQ(output.exit_code, 1) << output.text;
    ExpectSays(output, {what});
    EXPECT_FALSE(fs::exists(Path("bad")));
  };
  says({"--problem=heat_pinn"}, "unknown equation of evolution 'heat_pinn'");
  says({"--problem=kdv_pinn:num_t=0"}, "num_t=0");
  says({"--windows=0"}, "--windows=0 is out of range");
  says({"--method=geodesik"}, "did you mean geodesic?");
  says({"--hidden=20-x"}, "--hidden=20-x");
}

}  // namespace time_windows_program_test
}  // namespace invgrad
  // Beyond what the reference and the layer allow.
  says({"--problem=kdv_pinn:dispersion=1e-5"}, "dispersion=1e-5 is out of");
  says({"--problem=allen_cahn_pinn:diffusivity=0.1"}, "diffusivity=0.1 is out");
