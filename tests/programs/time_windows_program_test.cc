// The program time_windows, run as a user runs it.

#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
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
  // The directory holds files of the run alone.
  const Output again = Run({"--problem=burgers_pinn:num_t=2:num_x=2",
                            "--windows=1",
                            "--steps=1",
                            "--hidden=2",
                            "--noplots",
                            "--overwrite",
                            "--output=" + Path("run")});
  EXPECT_EQ(again.exit_code, 0) << again.text;
  EXPECT_FALSE(fs::exists(Path("run") + "/weights-1.npy"));
}

// 41 times for testing, the first of which no window counts.
TEST_F(TimeWindowsProgram, ADashStandsForNoTestPoints) {
  const Output output = Run({"--problem=burgers_pinn:num_t=1:num_x=1",
                             "--windows=45",
                             "--steps=1",
                             "--hidden=1",
                             "--noplots",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(output.text.find("nan"), std::string::npos) << output.text;
  ExpectSays(output, {"44", "L2_error of all times"});
}

TEST_F(TimeWindowsProgram, AWindowThatFailsIsAFailedRun) {
  const Output output = Run({"--problem=burgers_pinn:num_t=2:num_x=2",
                             "--windows=2",
                             "--method=gradient_descent:step_size=1e300",
                             "--hidden=2",
                             "--noplots",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 3) << output.text;
  ExpectSays(output, {"window 0, t from 0 to 0.5: ", "no run worked"});
}

TEST_F(TimeWindowsProgram, CtrlCReportsTheWindowsSoFar) {
  const pid_t child = Start({"--problem=burgers_pinn:num_t=2:num_x=2",
                             "--windows=2",
                             "--method=adam:step_size=1e-6",
                             "--seconds=1000000",
                             "--hidden=2",
                             "--noplots",
                             "--noprogress",
                             "--output=" + Path("run")});
  WaitForFile(Path("run/versions.txt"));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ::kill(child, SIGINT);
  const Output output = Wait(child);
  EXPECT_EQ(output.exit_code, 128 + SIGINT) << output.text;
  ExpectSays(output, {"L2_error of 0 <= t <= 0.5: "});
  Eigen::MatrixXd solution;
  std::string error;
  ASSERT_TRUE(ReadNpy(Path("run/solution.npy"), -1, 4, &solution, &error))
      << error;
  EXPECT_EQ(solution.rows(), 21 * 101);
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
  // Beyond what the reference and the layer allow.
  says({"--problem=kdv_pinn:dispersion=1e-5"}, "dispersion=1e-5 is out of");
  says({"--problem=allen_cahn_pinn:diffusivity=0.1"}, "diffusivity=0.1 is out");
  says({"--windows=0"}, "--windows=0 is out of range");
  says({"--method=geodesik"}, "did you mean geodesic?");
  says({"--hidden=20-x"}, "--hidden=20-x");
  for (const char* flag :
       {"--activation=relu", "--initialization=he", "--batch_size=3"}) {
    says({flag}, "unknown command line flag");
  }
}

}  // namespace time_windows_program_test
}  // namespace invgrad
