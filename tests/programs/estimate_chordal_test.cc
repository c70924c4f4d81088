// ceres_lm+chordal: from relaxed poses, if they cost less than the start.

#include <sstream>
#include <string>

#include "gtest/gtest.h"
#include "tests/programs/estimate_program.h"

namespace invgrad {
namespace estimate_chordal_test {

using EstimateChordal = EstimateProgram;

// Edges that agree, from poses that do not: the relaxation is the solution, and
// its time is in the history.
TEST_F(EstimateChordal, ALostStartIsRelaxed) {
  const std::string sure = " 10 0 0 10 0 100\n";
  const std::string input =
      WriteText("lost.g2o",
                "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 -7 3 2\nVERTEX_SE2 2 5 5 -1\n"
                "EDGE_SE2 0 1 1 0 0.5" +
                    sure + "EDGE_SE2 1 2 0 2 -1" + sure);
  const Output output =
      RunQuietly(input, "run", {"--methods=ceres_lm+chordal"});
  ExpectSays(output, {"converged", "from relaxed poses"});
  EXPECT_GT(std::stod(Results("run")[0][2]), 1.0);  // initial cost
  std::istringstream history(ReadAll(Path("run/lost/ceres_lm+chordal.csv")));
  std::string line;
  std::getline(history, line);  // titles
  double iteration = -1.0;
  double cost = -1.0;
  double seconds = 0.0;
  char comma;
  history >> iteration >> comma >> cost >> comma >> seconds;
  EXPECT_EQ(iteration, 0.0);
  EXPECT_LT(cost, 1e-20);
  EXPECT_GT(seconds, 0.0);
}

TEST_F(EstimateChordal, WithoutPosesThereIsNothingToRelax) {
  const Output output =
      RunQuietly(WriteMisra1a(), "run", {"--methods=ceres_lm+chordal"});
  ExpectSays(output, {"converged", "nothing to relax"});
}

TEST_F(EstimateChordal, ItIsNoRuleOfItsOwn) {
  const Output output =
      RunQuietly(WriteG2o2d(), "run", {"--methods=chordal"}, 3);
  ExpectSays(output, {"not run: chordal is a start for Ceres"});
}

}  // namespace estimate_chordal_test
}  // namespace invgrad
