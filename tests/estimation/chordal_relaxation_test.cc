#include "problems/estimation/chordal_relaxation.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/pose_graph.h"
#include "tests/estimation/poses.h"

namespace invgrad {
namespace chordal_relaxation_test {

using Eigen::Vector3d;

PoseGraph::Pose RandomPose(int dimension, NumpyGenerator* random) {
  const auto number = [&]() { return random->StandardNormal(); };
  if (dimension == 2) return Pose2d(number(), number(), 2.0 * number());
  const Vector3d position(number(), number(), number());
  return Pose3d(position, Vector3d(2.0 * number(), number(), number()));
}

// A ring of poses with chords, whose edges agree with the truth.
PoseGraph ExactGraph(int dimension, int num_poses) {
  NumpyGenerator random(3);
  PoseGraph graph;
  graph.dimension = dimension;
  graph.poses.resize(dimension == 2 ? 3 : 7, num_poses);
  for (int j = 0; j < num_poses; ++j) {
    graph.ids.push_back(j);
    graph.poses.col(j) = RandomPose(dimension, &random);
  }
  for (int j = 0; j < num_poses; ++j) {
    for (const int step : {1, 3}) {
      const int to = (j + step) % num_poses;
      PoseGraph::Edge edge =
          EdgeOf(Relative(graph.poses.col(j), graph.poses.col(to)));
      edge.from = j;
      edge.to = to;
      graph.edges.push_back(edge);
    }
  }
  return graph;
}

double CostOf(PoseGraph* graph) {
  ceres::Problem problem;
  AddPoseGraph(
      EdgeError::kG2o, [] { return nullptr; }, graph, &problem);
  double cost = 0.0;
  EXPECT_TRUE(problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
  return cost;
}

// All poses but the first are lost.
PoseGraph WithoutStart(PoseGraph graph) {
  NumpyGenerator random(8);
  for (Eigen::Index j = 1; j < graph.poses.cols(); ++j) {
    graph.poses.col(j) = RandomPose(graph.dimension, &random);
  }
  return graph;
}

TEST(ChordalRelaxation, ExactEdgesGiveTheTruthFromAnyStart) {
  for (const int dimension : {2, 3}) {
    PoseGraph graph = WithoutStart(ExactGraph(dimension, 12));
    EXPECT_GT(CostOf(&graph), 1.0);
    ASSERT_TRUE(RelaxChordally(&graph));
    EXPECT_LT(CostOf(&graph), 1e-20);
  }
}

TEST(ChordalRelaxation, FixedPosesStay) {
  PoseGraph graph = ExactGraph(2, 6);
  const Eigen::MatrixXd truth = graph.poses;
  graph = WithoutStart(graph);
  graph.poses.col(4) = truth.col(4);
  graph.poses.col(0).setZero();
  graph.fixed = {4};
  ASSERT_TRUE(RelaxChordally(&graph));
  EXPECT_EQ(graph.poses.col(4), truth.col(4));
  EXPECT_LT((graph.poses.topRows<2>() - truth.topRows<2>()).norm(), 1e-12);
}

TEST(ChordalRelaxation, NoisyEdgesComeCloseToTheLeastCost) {
  for (const int dimension : {2, 3}) {
    PoseGraph graph = ExactGraph(dimension, 20);
    NumpyGenerator random(4);
    for (PoseGraph::Edge& edge : graph.edges) {
      const int size = dimension == 2 ? 3 : 7;
      for (int i = 0; i < size; ++i) {
        edge.measurement[i] += 0.02 * random.StandardNormal();
      }
      if (dimension == 3) edge.measurement.tail<4>().normalize();
    }
    // The least cost is below that of the truth, and the start's is hundreds of
    // times higher.
    const double at_truth = CostOf(&graph);
    graph = WithoutStart(graph);
    EXPECT_GT(CostOf(&graph), 200.0 * at_truth);
    ASSERT_TRUE(RelaxChordally(&graph));
    EXPECT_LT(CostOf(&graph), 2.0 * at_truth);
  }
}

TEST(ChordalRelaxation, PriorsSensorsAndLandmarks) {
  const std::string sure = " 100 0 0 100 0 100\n";
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(
      "VERTEX_SE2 0 9 9 9\nVERTEX_SE2 1 8 8 8\n"
      "VERTEX_XY 7 5 5\n"
      "EDGE_PRIOR_SE2 0 1 2 0.5" +
          sure + "EDGE_SE2 0 1 1 0 0.25" + sure + "EDGE_SE2_XY 1 7 0 3 1 0 1\n",
      "f",
      &graph,
      &error))
      << error;
  ASSERT_TRUE(RelaxChordally(&graph));
  EXPECT_LT((graph.poses.col(0) - Vector3d(1.0, 2.0, 0.5)).norm(), 1e-14);
  const Vector3d second(1.0 + std::cos(0.5), 2.0 + std::sin(0.5), 0.75);
  EXPECT_LT((graph.poses.col(1) - second).norm(), 1e-14);
  EXPECT_LT((graph.landmarks.col(0) -
             (second.head<2>() +
              3.0 * Eigen::Vector2d(-std::sin(0.75), std::cos(0.75))))
                .norm(),
            1e-14);
}

TEST(ChordalRelaxation, WithoutAPathToAFixedPoseNothingChanges) {
  PoseGraph graph = ExactGraph(2, 8);
  graph.poses.conservativeResize(3, 9);
  graph.poses.col(8).setOnes();
  graph.ids.push_back(8);
  const Eigen::MatrixXd before = graph.poses;
  EXPECT_FALSE(RelaxChordally(&graph));
  EXPECT_EQ(graph.poses, before);
}

// Two rings: of the second one the decomposition sees rounding errors.
TEST(ChordalRelaxation, WithoutAPathToAFixedPoseARingStays) {
  for (const int dimension : {2, 3}) {
    for (int num_poses = 4; num_poses < 20; ++num_poses) {
      PoseGraph graph = ExactGraph(dimension, num_poses);
      const std::vector<PoseGraph::Edge> ring = graph.edges;
      for (PoseGraph::Edge edge : ring) {
        edge.from += num_poses;
        edge.to += num_poses;
        graph.edges.push_back(edge);
      }
      graph.poses = graph.poses.replicate(1, 2).eval();
      graph.ids.resize(2 * num_poses);
      const Eigen::MatrixXd before = graph.poses;
      EXPECT_FALSE(RelaxChordally(&graph)) << dimension << ", " << num_poses;
      EXPECT_EQ(graph.poses, before);
    }
  }
}

// Edges without information on positions, or on rotations, connect nothing.
TEST(ChordalRelaxation, AnEdgeOfNoWeightIsNoPath) {
  for (const int dimension : {2, 3}) {
    for (const bool has_positions : {false, true}) {
      PoseGraph graph = ExactGraph(dimension, 8);
      for (PoseGraph::Edge& edge : graph.edges) {
        auto& information = edge.information;
        if (edge.from != 0 && edge.to != 0) continue;
        information.diagonal().head(dimension) *= has_positions ? 1.0 : 0.0;
        information.diagonal().tail(information.rows() - dimension) *=
            has_positions ? 0.0 : 1.0;
      }
      const Eigen::MatrixXd before = graph.poses;
      EXPECT_FALSE(RelaxChordally(&graph));
      EXPECT_EQ(graph.poses, before);
    }
  }
}

}  // namespace chordal_relaxation_test
}  // namespace invgrad
