#include "problems/estimation/pose_graph.h"

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Geometry"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "tests/estimation/poses.h"

namespace invgrad {
namespace pose_graph_test {

TEST(PoseGraph, ManifoldKeepsAnglesInOneTurn) {
  const std::unique_ptr<ceres::Manifold> manifold(MakePoseManifold2d());
  const Eigen::Vector3d x(1.0, 2.0, 3.0);
  const Eigen::Vector3d delta(0.5, -0.5, 1.0);
  Eigen::Vector3d sum;
  ASSERT_TRUE(manifold->Plus(x.data(), delta.data(), sum.data()));
  EXPECT_LT((sum - Eigen::Vector3d(1.5, 1.5, 4.0 - 2.0 * kPi)).norm(), 1e-14);
  Eigen::Vector3d difference;
  ASSERT_TRUE(manifold->Minus(sum.data(), x.data(), difference.data()));
  EXPECT_LT((difference - delta).norm(), 1e-14);
}

// A round trip over the corners of a square, or of a turning path in space.
PoseGraph Loop(int dimension) {
  PoseGraph graph;
  graph.dimension = dimension;
  graph.poses.resize(dimension == 2 ? 3 : 7, 4);
  for (int i = 0; i < 4; ++i) {
    const double angle = 0.5 * kPi * i - 2.0;  // in one turn
    graph.ids.push_back(i);
    if (dimension == 2) {
      graph.poses.col(i) = Pose2d(std::cos(angle), std::sin(angle), angle);
    } else {
      graph.poses.col(i) = Pose3d({std::cos(angle), std::sin(angle), 0.3 * i},
                                  {0.1, 0.1 + 0.2 * i, 0.3});
    }
  }
  for (int i = 0; i < 4; ++i) {
    const int next = (i + 1) % 4;
    PoseGraph::Edge edge =
        EdgeOf(Relative(graph.poses.col(i), graph.poses.col(next)));
    edge.from = i;
    edge.to = next;
    graph.edges.push_back(edge);
  }
  return graph;
}

double Minimize(PoseGraph* graph, EdgeError edge_error = EdgeError::kG2o) {
  ceres::Problem problem;
  AddPoseGraph(
      edge_error, [] { return nullptr; }, graph, &problem);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.function_tolerance = 1e-18;
  options.gradient_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.final_cost;
}

TEST(PoseGraph, FindsExactPosesAgain) {
  for (const int dimension : {2, 3}) {
    SCOPED_TRACE(dimension);
    const PoseGraph exact = Loop(dimension);
    for (const std::vector<int>& fixed :
         {std::vector<int>{}, std::vector<int>{2}}) {
      PoseGraph graph = exact;
      graph.fixed = fixed;
      const int constant = fixed.empty() ? 0 : 2;
      NumpyRandom random(4);
      PerturbPoseGraph(0.1, &random, &graph);
      EXPECT_EQ(graph.poses.col(constant), exact.poses.col(constant));
      EXPECT_GT((graph.poses - exact.poses).norm(), 0.1);
      // Where Ceres ends, on a gradient of 1e-14 or no change, errors are some
      // 1e-8.
      EXPECT_LT(Minimize(&graph), 1e-14);
      EXPECT_EQ(graph.poses.col(constant), exact.poses.col(constant));
      EXPECT_LT((graph.poses - exact.poses).norm(), 1e-6);
    }
  }
}

// Two edges from the origin to a pose that is turned by a quarter: in the frame
// of the measurement the first knows y = -x of the pose ten times as exactly,
// the second the other axis. By weighted means of x and y.
TEST(PoseGraph, InformationIsInTheFrameOfTheMeasurement) {
  const std::string text =
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.2 0.1 1.5\n"
      "EDGE_SE2 0 1 1 0 1.5707963267948966 100 0 0 1 0 1000\n"
      "EDGE_SE2 0 1 1.4 0.3 1.5707963267948966 1 0 0 100 0 1000\n";
  PoseGraph graph = ParsedG2o(text);
  Minimize(&graph);
  EXPECT_LT(
      (graph.poses.col(1) -
       Eigen::Vector3d((1.0 + 100.0 * 1.4) / 101.0, 0.3 / 101.0, 0.5 * kPi))
          .norm(),
      1e-7);
  // Ceres weights in the frame of the first pose.
  graph = ParsedG2o(text);
  Minimize(&graph, EdgeError::kCeres);
  EXPECT_LT((graph.poses.col(1) -
             Eigen::Vector3d((100.0 + 1.4) / 101.0, 30.0 / 101.0, 0.5 * kPi))
                .norm(),
            1e-7);
}

TEST(PoseGraph, AnEdgeMayKnowOneCoordinateOnly) {
  PoseGraph graph = ParsedG2o(
      "EDGE_SE2 0 1 1.1 0 0 400 0 0 0 0 0\n"
      "EDGE_SE2 0 1 0 0 0.3 0 0 0 0 0 250\n"
      "EDGE_SE2 0 1 1 0.2 0.1 100 0 0 100 0 100\n");
  Minimize(&graph);
  // The measurements are turned by 0, 0.3 and 0.1, but only x is known to the
  // first: y and the angle are of the other two.
  EXPECT_NEAR(graph.poses(0, 1), (440.0 + 100.0) / 500.0, 1e-9);
  EXPECT_NEAR(graph.poses(1, 1), 0.2, 1e-9);
  EXPECT_NEAR(graph.poses(2, 1), (0.3 * 250.0 + 0.1 * 100.0) / 350.0, 1e-9);
}

// The pose of the prior's sensor is the measurement, and the landmark lies
// where the sensor sees it.
TEST(PoseGraph, PriorsHoldAGraphInItsPlace) {
  PoseGraph graph = ParsedG2o(
      "VERTEX_SE3:QUAT 3 9 9 9 0 0 0 1\nVERTEX_TRACKXYZ 4 0 0 0\n"
      "PARAMS_SE3OFFSET 7 0 0 1 0 0 0 1\n"
      "EDGE_SE3_PRIOR 3 7 1 2 3 0 0 1 1"
      " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"
      "EDGE_SE3_TRACKXYZ 3 4 7 5 0 0 1 0 0 1 0 1\n");
  // Where Ceres ends, errors are some 1e-8.
  EXPECT_LT(Minimize(&graph), 1e-14);
  EXPECT_LT((graph.poses.col(0).head<3>() - Eigen::Vector3d(1, 2, 2)).norm(),
            1e-7);
  EXPECT_LT((Rotation(graph.poses.col(0)) * Eigen::Vector3d::UnitX() -
             Eigen::Vector3d::UnitY())
                .norm(),
            1e-7);
  EXPECT_LT((graph.landmarks.col(0) - Eigen::Vector3d(1, 7, 3)).norm(), 1e-7);
}

TEST(PoseGraph, CeresErrorIsOfEdgesBetweenPosesOnly) {
  const std::string edge = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
  std::string error;
  EXPECT_TRUE(HasEdgeError(ParsedG2o(edge), EdgeError::kCeres, &error))
      << error;
  EXPECT_FALSE(
      HasEdgeError(ParsedG2o(edge + "EDGE_PRIOR_SE2 0 1 0 0 1 0 0 1 0 1\n"),
                   EdgeError::kCeresUpper,
                   &error));
  EXPECT_NE(error.find("EDGE_SE2"), std::string::npos) << error;
  const PoseGraph semidefinite = ParsedG2o("EDGE_SE2 5 8 1 0 0 1 0 0 1 0 0\n");
  EXPECT_TRUE(HasEdgeError(semidefinite, EdgeError::kCeresUpper, &error));
  EXPECT_FALSE(HasEdgeError(semidefinite, EdgeError::kCeres, &error));
  EXPECT_NE(error.find("from 5 to 8"), std::string::npos) << error;
}

// A robot that stands still: three poses, two zero edges. At a heading of pi the
// gradient that Ceres makes of Plus must not be 2 pi.
TEST(PoseGraph, ARobotMayStandStillAtAHeadingOfHalfATurn) {
  for (const double heading : {kPi, -kPi, 3.0, 3.5}) {
    SCOPED_TRACE(heading);
    PoseGraph graph;
    graph.dimension = 2;
    graph.poses.resize(3, 3);
    for (int i = 0; i < 3; ++i) {
      graph.ids.push_back(i);
      graph.poses.col(i) = Pose2d(1.0, 2.0, heading);
    }
    for (int i = 0; i < 2; ++i) {
      PoseGraph::Edge edge = EdgeOf(Pose2d(0.0, 0.0, 0.0));
      edge.from = i;
      edge.to = i + 1;
      graph.edges.push_back(edge);
    }
    ceres::Problem problem;
    AddPoseGraph(
        EdgeError::kG2o, [] { return nullptr; }, &graph, &problem);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
        << summary.FullReport();
    EXPECT_LT(summary.final_cost, 1e-20);
  }
}

TEST(PoseGraph, NoiseKeepsPosesPoses) {
  for (const int dimension : {2, 3}) {
    PoseGraph graph = Loop(dimension);
    NumpyRandom random(4);
    PerturbPoseGraph(3.0, &random, &graph);
    for (int j = 0; j < 4; ++j) {
      if (dimension == 3) {
        EXPECT_NEAR(graph.poses.col(j).tail<4>().norm(), 1.0, 1e-14);
      } else {
        EXPECT_LE(std::abs(graph.poses(2, j)), kPi);
      }
    }
  }
}

}  // namespace pose_graph_test
}  // namespace invgrad
