// The program separable_fits, run as a user runs it.

#include <string>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace separable_fits_program_test {

class SeparableFitsProgram : public ProgramRunner {
 protected:
  SeparableFitsProgram() : ProgramRunner("separable_fits") {}
};

// Two exponentials from good starts: every way finds the minimum each time.
TEST_F(SeparableFitsProgram, HasARowForEveryWay) {
  const Output output = Run({"--starts=3",
                             "--terms=2",
                             "--amplitude=1",
                             "--sides=20",
                             "--samples=20",
                             "--repetitions=1"});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output,
             {"| 2 | LM | ",
              "| 2 | LM with half-inverse proposals | ",
              "| 2 | variable projection, Kaufman | ",
              "| 2 | variable projection, Golub-Pereyra | ",
              "20 right-hand sides of 20 samples",
              "| ceres::Solve, DENSE_SCHUR, amplitudes first | ",
              "| FitGlobal | "});
}

TEST_F(SeparableFitsProgram, RefusesWrongFlags) {
  for (const std::string flag : {"--terms=2,7",
                                 "--terms=",
                                 "--noise=0",
                                 "--starts=0",
                                 "--samples=5",
                                 "--part=none"}) {
    const Output output = Run({flag});
    EXPECT_EQ(output.exit_code, 1) << flag << output.text;
    ExpectSays(output, {flag.substr(0, flag.find('='))});
  }
}

}  // namespace separable_fits_program_test
}  // namespace invgrad
