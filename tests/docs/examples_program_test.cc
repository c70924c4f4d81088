// The examples find the truth, with and without half-inverse steps. Each exits
// with 0 only if its estimates are within the tolerance that it states.

#include <string>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace examples_program_test {

class ExamplesTest : public ProgramRunner {
 protected:
  ExamplesTest() : ProgramRunner("example_curve_fitting") {}

  Output RunExample(const std::string& name) const {
    return Wait(StartProgram("example_" + name, {}));
  }

  // Every example reports each solver, counts the proposals and says how it
  // ended.
  static void ExpectTruthFound(const Output& output) {
    EXPECT_EQ(output.exit_code, 0) << output.text;
    ExpectSays(output,
               {"LM",
                "LM + half-inverse",
                " proposed, ",
                " accepted, ",
                " steps of Ceres",
                "truth found"});
  }
};

TEST_F(ExamplesTest, CurveFitting) {
  const Output output = RunExample("curve_fitting");
  ExpectTruthFound(output);
  ExpectSays(output, {"squared loss, LM: ", "Cauchy loss, LM: "});
}

TEST_F(ExamplesTest, BundleAdjustment) {
  const Output output = RunExample("bundle_adjustment");
  ExpectTruthFound(output);
  ExpectSays(output, {"LM: ", "error of points"});
}

TEST_F(ExamplesTest, PoseGraph) {
  const Output output = RunExample("pose_graph");
  ExpectTruthFound(output);
  ExpectSays(output, {"error of the odometry", "error of positions"});
}

TEST_F(ExamplesTest, ParameterIdentification) {
  const Output output = RunExample("parameter_identification");
  ExpectTruthFound(output);
  ExpectSays(output, {"found only by LM: ", " of 100"});
}

}  // namespace examples_program_test
}  // namespace invgrad
