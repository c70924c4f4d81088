// The program scaling, run as a user runs it.

#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rules/rules.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace scaling_program_test {

class ScalingProgram : public ProgramRunner {
 protected:
  ScalingProgram() : ProgramRunner("scaling") {}

  // The exponents in the row of `rule`.
  static std::vector<std::string> Row(const Output& output,
                                      const std::string& rule) {
    std::istringstream lines(output.text);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream cells(line);
      std::string name;
      if (!(cells >> name) || name != rule) continue;
      std::vector<std::string> exponents;
      for (std::string cell; cells >> cell;) exponents.push_back(cell);
      return exponents;
    }
    return {};
  }
};

TEST_F(ScalingProgram, HasARowForEveryRule) {
  const Output output = Run({});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  for (const RuleRow& row : Rules()) {
    EXPECT_EQ(Row(output, row.name).size(), 3u) << row.name;
  }
  // One that needs the layers of a network says so.
  EXPECT_EQ(Row(output, "kfac_half_inverse"),
            (std::vector<std::string>{"-", "-", "-"}));
  ExpectSays(output, {"kfac_half_inverse: K-FAC needs"});
  ExpectSays(Run({"--rules=kfac_half_inverse"}), {"K-FAC needs"});
}

// docs/conventions.md, section 3, and problems/linear_scale.h: with the loss,
// with the own unit, with the other's unit.
TEST_F(ScalingProgram, ExponentsAreThoseOfTheConventions) {
  const Output output =
      Run({"--rules=gradient_descent,half_inverse,gauss_newton,adam,"
           "power:kappa=0.75"});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  using Exponents = std::vector<std::string>;
  EXPECT_EQ(Row(output, "gradient_descent"), (Exponents{"1", "1", "0"}));
  EXPECT_EQ(Row(output, "half_inverse"), (Exponents{"1", "-0.5", "0"}));
  EXPECT_EQ(Row(output, "gauss_newton"), (Exponents{"1", "-1", "0"}));
  EXPECT_EQ(Row(output, "power:kappa=0.75"), (Exponents{"1", "-0.75", "0"}));
  EXPECT_EQ(Row(output, "adam"), (Exponents{"0", "0", "0"}));
}

TEST_F(ScalingProgram, RefusesBadInput) {
  Output output = Run({"--rules=half_inverz"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--rules", "half_inverz", "half_inverse"});
  output = Run({"--rules=adam:step_size=-2"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"step_size=-2", "allowed"});
  output = Run({"stray"});
  EXPECT_EQ(output.exit_code, 1);
  // The linear model of a linear loss has no minimizer.
  output = Run({"--rules=half_inverse:step_size=auto"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"half_inverse:step_size=auto"});
}

}  // namespace scaling_program_test
}  // namespace invgrad
