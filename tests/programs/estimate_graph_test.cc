// The program estimate on g2o's files, as they are published.

#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/estimation/g2o_file.h"
#include "tests/programs/estimate_program.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace estimate_graph_test {

class EstimateGraph : public EstimateProgram {
 protected:
  // The result of ceres_lm on a text.
  PoseGraph Solve(const std::string& text,
                  const std::vector<std::string>& arguments = {}) {
    std::vector<std::string> all = {
        "--methods=ceres_lm", "--overwrite", "--function_tolerance=0"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    output_ = RunQuietly(WriteText("in.g2o", text), "run", all);
    PoseGraph graph;
    std::string error;
    EXPECT_TRUE(ReadG2oFile(Path("run") + "/in/ceres_lm.g2o", &graph, &error))
        << error;
    return graph;
  }

  Output output_;
};

// Two measurements of a pose, each of which knows one axis of its own frame.
TEST_F(EstimateGraph, WeightsInTheFrameOfTheMeasurement) {
  const std::string text =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.2 0.1 1.5\n"
      "EDGE_SE2 0 1 1 0 1.5707963267948966 100 0 0 1 0 1000\n"
      "EDGE_SE2 0 1 1.4 0.3 1.5707963267948966 1 0 0 100 0 1000\n";
  PoseGraph graph = Solve(text);
  EXPECT_NEAR(graph.poses(0, 1), 141.0 / 101.0, 1e-6);
  EXPECT_NEAR(graph.poses(1, 1), 0.3 / 101.0, 1e-6);
  graph = Solve(text, {"--edge_error=ceres"});
  EXPECT_NEAR(graph.poses(0, 1), 101.4 / 101.0, 1e-6);
  EXPECT_NEAR(graph.poses(1, 1), 30.0 / 101.0, 1e-6);
}

TEST_F(EstimateGraph, ReadsSemidefiniteEdgesWithoutVertices) {
  const PoseGraph graph = Solve(
      "\xEF\xBB\xBF"
      "FIX 0\nEDGE_SE2 0 1 1.1 0 0 400 0 0 0 0 0\n"
      "EDGE_SE2 0 1 0 0 0.3 0 0 0 0 0 250\n"
      "EDGE_SE2 0 1 1 0.2 0.1 100 0 0 100 0 100\n");
  EXPECT_NEAR(graph.poses(0, 1), 1.08, 1e-9);
  EXPECT_NEAR(graph.poses(1, 1), 0.2, 1e-9);
  EXPECT_NEAR(graph.poses(2, 1), 0.242857, 1e-6);
  EXPECT_EQ(graph.fixed, std::vector<int>{0});
  ExpectSays(output_,
             {"2 poses, 3 edges, 2D; 2 without a VERTEX line start along a "
              "spanning tree of the edges"});
}

// A line of two steps of together 2.2, with priors at its ends that say 2, and
// a landmark seen from both ends, which says 2, too. By symmetry x_0 = -e and
// x_2 = 2 + e; the squares 2 e^2 of the priors, (0.2 - 2 e)^2 / 2 of the steps
// and 2 e^2 of the landmark are least at e = 1/30, with
// x_1 = x_0 + 1 - (0.2 - 2 e) / 2.
TEST_F(EstimateGraph, SolvesPriorsAndLandmarks) {
  const std::string sure = " 100 0 0 100 0 100\n";
  const PoseGraph graph = Solve(
      "EDGE_PRIOR_SE2 0 0 0 0" + sure + "EDGE_SE2 0 1 1 0 0" + sure +
          "EDGE_SE2 1 2 1.2 0 0" + sure + "EDGE_PRIOR_SE2 2 2 0 0" + sure +
          "EDGE_SE2_XY 0 7 1 0 100 0 100\n"
          "EDGE_SE2_XY 2 7 -1 0 100 0 100\n",
      {"--covariance"});
  EXPECT_NEAR(graph.poses(0, 0), -1.0 / 30.0, 1e-7);
  EXPECT_NEAR(graph.poses(0, 1), 0.9, 1e-7);
  EXPECT_NEAR(graph.poses(0, 2), 2.0 + 1.0 / 30.0, 1e-7);
  EXPECT_LT((graph.landmarks.col(0) - Eigen::Vector2d(1.0, 0.0)).norm(), 1e-7);
  ExpectSays(output_, {"3 poses, 1 landmarks, 6 edges", "11 of 11"});
}

// Ceres 2.1 has iterated at such a cost; later versions refuse it themselves.
TEST_F(EstimateGraph, ACostThatIsNotFiniteIsAFailure) {
  const Output output =
      Run({"--input=" + WriteText("far.g2o",
                                  "VERTEX_SE2 0 0 0 0\n"
                                  "VERTEX_SE2 1 1e300 0 0\n"
                                  "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"),
           "--methods=ceres_lm",
           "--noplots",
           "--noprogress",
           "--output=" + Path("far")});
  EXPECT_EQ(output.exit_code, 3) << output.text;
  ExpectSays(output, {"failed: ", "0 of 1"});
}

TEST_F(EstimateGraph, RefusesOtherTagsByName) {
  ExpectRefused({"--input=" + WriteText("bearing.g2o",
                                        "VERTEX_SE2 0 0 0 0\nVERTEX_XY 1 1 1\n"
                                        "EDGE_BEARING_SE2_XY 0 1 0.5 10\n")},
                {"bearing.g2o:3", "EDGE_BEARING_SE2_XY", "EDGE_SE2_XY"});
  ExpectRefused({"--input=" + WriteText("prior.g2o",
                                        "EDGE_PRIOR_SE2 0 1 0 0 1 0 0 1 0 1\n"),
                 "--edge_error=ceres"},
                {"prior.g2o", "EDGE_SE2 and EDGE_SE3:QUAT only"});
}

// The edges of the published files, without their vertices: start values by a
// spanning tree lead to the minima.
TEST_F(EstimateGraph, OptimizesPublishedEdgesWithoutVertices) {
  for (const char* name : {"g2o/M3500.g2o", "g2o/sphere2500.g2o"}) {
    const std::string path = PublishedData(name);
    if (path.empty()) {
      GTEST_SKIP() << "https://lucacarlone.mit.edu/datasets/ has the files";
    }
    std::istringstream lines(ReadAll(path));
    std::string edges;
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("EDGE", 0) == 0) edges += line + "\n";
    }
    const Output output = RunQuietly(path + "," + WriteText("edges.g2o", edges),
                                     "run",
                                     {"--methods=ceres_lm", "--overwrite"});
    ExpectSays(output, {"start along a spanning tree of the edges"});
    const auto rows = Results("run");
    ASSERT_EQ(rows.size(), 2);
    const double cost = std::stod(rows[0][3]);
    EXPECT_NEAR(std::stod(rows[1][3]), cost, 1e-4 * cost) << name;
  }
}

}  // namespace estimate_graph_test
}  // namespace invgrad
