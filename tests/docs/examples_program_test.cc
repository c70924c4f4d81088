// The examples find the truth, estimators with and without proposals.
// Each exits with 0 only if its estimates are within the tolerance that it
// states.

#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace examples_program_test {

class ExamplesTest : public ProgramRunner {
 protected:
  ExamplesTest() : ProgramRunner("example_curve_fitting") {}

  Output RunExample(const std::string& name,
                    const std::vector<std::string>& arguments = {}) const {
    return Wait(StartProgram("example_" + name, arguments));
  }

  // Every example reports each solver, counts the proposals and says how it
  // ended.
  static void ExpectTruthFound(const Output& output, const std::string& rule) {
    EXPECT_EQ(output.exit_code, 0) << output.text;
    ExpectSays(output,
               {"LM",
                "LM + " + rule,
                " proposed, ",
                " accepted, ",
                " steps of Ceres",
                "truth found"});
  }
};

TEST_F(ExamplesTest, CurveFitting) {
  const Output output = RunExample("curve_fitting");
  ExpectTruthFound(output, "geodesic");
  ExpectSays(output, {"squared loss, LM: ", "Cauchy loss, LM: "});
}

TEST_F(ExamplesTest, BundleAdjustment) {
  const Output output = RunExample("bundle_adjustment");
  ExpectTruthFound(output, "geodesic");
  ExpectSays(output, {"LM: ", "error of points"});
}

TEST_F(ExamplesTest, PoseGraph) {
  const Output output = RunExample("pose_graph");
  ExpectTruthFound(output, "geodesic");
  ExpectSays(output, {"error of the odometry", "error of positions"});
}

TEST_F(ExamplesTest, ChordalStart) {
  const Output output = RunExample("chordal_start");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"relaxed poses: error", "truth found"});
}

TEST_F(ExamplesTest, ParameterIdentification) {
  const Output output = RunExample("parameter_identification");
  ExpectTruthFound(output, "half-inverse");
  ExpectSays(output, {"found only by LM: ", " of 100"});
}

// It fails if the proposals solve fewer poses than plain LM, or less than 90 %.
TEST_F(ExamplesTest, InverseKinematics) {
  const Output output = RunExample("inverse_kinematics");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"exact inverse:", "LM + inverse", " of 1000 poses"});
}

// It fails if the physical gradient is not exact.
TEST_F(ExamplesTest, PhysicalGradients) {
  const Output output = RunExample("physical_gradients");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"Fall of the loss", "Change of y", "Lyapunov times"});
}

TEST_F(ExamplesTest, LeastDrag) {
  const Output output = RunExample("least_drag", {"0.3"});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"closed form", "80 shapes, adam", "truth found"});
}

// It fails if the error bars do not cover the errors that noise makes.
TEST_F(ExamplesTest, ErrorBars) {
  const Output output = RunExample("error_bars", {"2"});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"prior: evidence", "beyond the data", "Burgers, "});
}

TEST_F(ExamplesTest, TrainedNetworks) {
  const Output output =
      RunExample("trained_networks", {Path("trained_networks.txt")});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(
      output,
      {"Where to stand", "Break-even", "networks at x > 0", "truth found"});
  std::istringstream file(ReadAll(Path("trained_networks.txt")));
  int num_values = 0;
  for (double value = 0.0; file >> value;) ++num_values;
  EXPECT_EQ(num_values, 151 * 22);
}

}  // namespace examples_program_test
}  // namespace invgrad
