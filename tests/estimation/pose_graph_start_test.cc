#include "problems/estimation/pose_graph_start.h"

#include <cmath>
#include <string>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "problems/estimation/g2o_file.h"
#include "tests/estimation/poses.h"

namespace invgrad {
namespace pose_graph_start_test {

Eigen::Vector3d PoseOf(const PoseGraph& graph, long id) {
  for (size_t j = 0; j < graph.ids.size(); ++j) {
    if (graph.ids[j] == id) return graph.poses.col(j);
  }
  ADD_FAILURE() << "no pose " << id;
  return {};
}

const char kSure[] = " 1 0 0 1 0 1\n";

// A square, walked around to the left, in both directions of its edges.
TEST(PoseGraphStart, FollowsTheEdges) {
  const PoseGraph graph =
      ParsedG2o(fmt::format("EDGE_SE2 0 1 1 0 {0}{1}EDGE_SE2 2 1 0 1 -{0}{1}"
                            "EDGE_SE2 2 3 1 0 {0}{1}",
                            0.5 * kPi,
                            kSure));
  EXPECT_EQ(graph.num_poses_by_edges, 4);
  EXPECT_EQ(PoseOf(graph, 0), Eigen::Vector3d(0.0, 0.0, 0.0));
  EXPECT_LT((PoseOf(graph, 1) - Eigen::Vector3d(1.0, 0.0, 0.5 * kPi)).norm(),
            1e-14);
  const Eigen::Vector3d third = PoseOf(graph, 2);
  EXPECT_LT((third - Eigen::Vector3d(1.0, 1.0, third[2])).norm(), 1e-14);
  EXPECT_NEAR(std::abs(third[2]), kPi, 1e-14);
  EXPECT_LT((PoseOf(graph, 3) - Eigen::Vector3d(0.0, 1.0, -0.5 * kPi)).norm(),
            1e-14);
}

TEST(PoseGraphStart, KeepsValuesThatAreThere) {
  const PoseGraph graph =
      ParsedG2o("EDGE_SE2 3 9 1 0 0" + std::string(kSure) +
                "VERTEX_SE2 9 5 6 0\nEDGE_SE2 9 4 0 2 0" + kSure);
  EXPECT_EQ(graph.ids, (std::vector<long>{9, 3, 4}));
  EXPECT_EQ(graph.num_poses_by_edges, 2);
  EXPECT_EQ(PoseOf(graph, 9), Eigen::Vector3d(5.0, 6.0, 0.0));
  EXPECT_EQ(PoseOf(graph, 3), Eigen::Vector3d(4.0, 6.0, 0.0));
  EXPECT_EQ(PoseOf(graph, 4), Eigen::Vector3d(5.0, 8.0, 0.0));
}

// The edge that knows x only leads straight to pose 2.
TEST(PoseGraphStart, PrefersEdgesThatKnowEverything) {
  const PoseGraph graph =
      ParsedG2o("EDGE_SE2 0 2 7 0 0 400 0 0 0 0 0\nEDGE_SE2 0 1 1 2 0" +
                std::string(kSure) + "EDGE_SE2 1 2 1 0 0" + kSure);
  EXPECT_EQ(PoseOf(graph, 2), Eigen::Vector3d(2.0, 2.0, 0.0));
}

TEST(PoseGraphStart, PrefersShortPaths) {
  const PoseGraph graph =
      ParsedG2o("EDGE_SE2 0 1 1 0 0" + std::string(kSure) +
                "EDGE_SE2 1 2 1 0 0" + kSure + "EDGE_SE2 0 2 2.5 0 0" + kSure);
  EXPECT_EQ(PoseOf(graph, 2), Eigen::Vector3d(2.5, 0.0, 0.0));
}

TEST(PoseGraphStart, PartsWithoutValuesBeginAtAPriorOrAtTheOrigin) {
  const PoseGraph graph = ParsedG2o("EDGE_SE2 0 1 1 0 0" + std::string(kSure) +
                                    "EDGE_SE2 5 6 1 0 0" + kSure +
                                    "EDGE_PRIOR_SE2 6 3 4 0" + kSure);
  EXPECT_EQ(PoseOf(graph, 1), Eigen::Vector3d(1.0, 0.0, 0.0));
  EXPECT_EQ(PoseOf(graph, 6), Eigen::Vector3d(3.0, 4.0, 0.0));
  EXPECT_EQ(PoseOf(graph, 5), Eigen::Vector3d(2.0, 4.0, 0.0));
}

// A sensor 1 above the first pose and turned by a half turn about z, and one 2
// ahead of the second: both poses and the landmark in the world.
TEST(PoseGraphStart, SensorsAreOnThePoses) {
  const std::string sure = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  const PoseGraph graph = ParsedG2o(
      "PARAMS_SE3OFFSET 0 0 0 1 0 0 1 0\nPARAMS_SE3OFFSET 1 2 0 0 0 0 0 1\n"
      "EDGE_SE3_PRIOR 3 0 0 0 0 0 0 0 1" +
      sure + "EDGE_SE3_OFFSET 3 4 0 1 5 0 0 0 0 0 1" + sure +
      "EDGE_SE3_TRACKXYZ 4 8 1 1 2 3 1 0 0 1 0 1\n");
  // The prior puts the sensor at the origin.
  EXPECT_LT((graph.poses.col(0).head<3>() - Eigen::Vector3d(0, 0, -1)).norm(),
            1e-14);
  EXPECT_NEAR(std::abs(graph.poses(5, 0)), 1.0, 1e-14);
  // The second sensor is 5 ahead in the world, the pose 2 behind it.
  EXPECT_LT((graph.poses.col(1).head<3>() - Eigen::Vector3d(3, 0, 0)).norm(),
            1e-14);
  EXPECT_LT((graph.landmarks.col(0) - Eigen::Vector3d(6, 2, 3)).norm(), 1e-14);
}

TEST(PoseGraphStart, OverflowIsRefused) {
  PoseGraph graph;
  std::string error;
  EXPECT_FALSE(ParseG2o("EDGE_SE2 0 1 1e308 0 0" + std::string(kSure) +
                            "EDGE_SE2 1 2 1e308 0 0" + kSure,
                        "f",
                        &graph,
                        &error));
  EXPECT_NE(error.find("overflow"), std::string::npos) << error;
}

}  // namespace pose_graph_start_test
}  // namespace invgrad
