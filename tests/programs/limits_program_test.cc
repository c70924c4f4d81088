// What compare and sweep say of sizes that do not fit.

#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace limits_program_test {

class LimitsProgram : public ProgramRunner {
 protected:
  LimitsProgram() : ProgramRunner("compare") {}

  static int Count(const std::string& text, const std::string& word) {
    int count = 0;
    for (size_t at = text.find(word); at != std::string::npos;
         at = text.find(word, at + 1)) {
      ++count;
    }
    return count;
  }
};

TEST_F(LimitsProgram, RefusesDataThatDoNotFit) {
  ExpectRefused(
      {"--problem=oscillator_correction:num_samples=10000000:horizon=100000"},
      {"problem oscillator_correction: num_samples=10000000",
       "needs 128 TB for its data; the limit is ",
       "(three quarters of "});
}

// The method that does not fit is a row that says so; the others run.
TEST_F(LimitsProgram, ABatchThatDoesNotFitIsNotRun) {
  // A Hessian of a million weights.
  const Output output = Run({"--problem=oscillator_chain:num_samples=100",
                             "--hidden=1000-1000",
                             "--batch_size=100",
                             "--rules=newton,adam",
                             "--steps=1",
                             "--plots=false",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 2) << output.text;
  ExpectSays(output,
             {"newton: batch_size=100 needs ",
              "(Hessian and its factorization ",
              "the limit is ",
              "not run: batch_size=100 needs",
              "steps done"});
}

TEST_F(LimitsProgram, SamplesThatFillNoBatchAreReportedOnceABatchSize) {
  const std::string rules =
      "adam,gradient_descent,adam:batch_size=48,adam:batch_size=16,ceres_lm";
  const Output output = Run({"--problem=oscillator_chain:num_samples=64",
                             "--batch_size=20",
                             "--rules=" + rules,
                             "--seeds=1,2",
                             "--steps=1",
                             "--plots=false",
                             "--output=" + Path("run")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(Count(output.text,
                  "batch_size=20: 4 of 64 samples are left out of every "
                  "epoch; divisors near: 16, 32"),
            1)
      << output.text;
  EXPECT_EQ(Count(output.text,
                  "batch_size=48: 16 of 64 samples are left out of every "
                  "epoch; divisors near: 32, 64"),
            1)
      << output.text;
  EXPECT_EQ(Count(output.text, "left out"), 2) << output.text;
}

TEST_F(LimitsProgram, SweepReportsThemToo) {
  const Output output =
      Wait(StartProgram("sweep",
                        {"--problem=oscillator_chain:num_samples=64",
                         "--grid=batch_size=16,20;rule=adam;seed=1,2",
                         "--steps=1",
                         "--plots=false",
                         "--output=" + Path("sweep")}));
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(Count(output.text, "batch_size=20: 4 of 64 samples are left out"),
            1)
      << output.text;
  EXPECT_EQ(Count(output.text, "left out"), 1) << output.text;
}

}  // namespace limits_program_test
}  // namespace invgrad
