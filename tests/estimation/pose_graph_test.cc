#include "problems/estimation/pose_graph.h"

#include <cmath>
#include <memory>
#include <vector>

#include "Eigen/Geometry"
#include "ceres/gradient_checker.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace pose_graph_test {

constexpr double kPi = 3.14159265358979323846;
using Pose = PoseGraph::Pose;

Pose Pose2d(double x, double y, double theta) {
  Pose pose(3);
  pose << x, y, theta;
  return pose;
}

Pose Pose3d(const Eigen::Vector3d& position, const Eigen::Vector3d& turn) {
  Pose pose(7);
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  pose << position, rotation.coeffs();
  return pose;
}

Eigen::Quaterniond Rotation(const Pose& pose) {
  return Eigen::Quaterniond(Eigen::Vector4d(pose.tail<4>()));
}

// b as a sees it.
Pose Relative(const Pose& a, const Pose& b) {
  if (a.size() == 3) {
    const Eigen::Vector2d step = Eigen::Rotation2Dd(-a[2]) * (b - a).head<2>();
    return Pose2d(step[0], step[1], b[2] - a[2]);
  }
  Pose pose(7);
  pose << Rotation(a).conjugate() * Eigen::Vector3d((b - a).head<3>()),
      (Rotation(a).conjugate() * Rotation(b)).coeffs();
  return pose;
}

PoseGraph::Edge EdgeOf(const Pose& measurement) {
  PoseGraph::Edge edge;
  edge.from = 0;
  edge.to = 1;
  edge.measurement = measurement;
  const int size = measurement.size() == 3 ? 3 : 6;
  // Positive definite, as it is diagonally dominant, and not diagonal.
  edge.information = Eigen::MatrixXd::Constant(size, size, 0.5);
  for (int i = 0; i < size; ++i) edge.information(i, i) = 10.0 + i;
  return edge;
}

Eigen::VectorXd Error(const PoseGraph::Edge& edge,
                      const Pose& a,
                      const Pose& b,
                      InformationRoot root = InformationRoot::kUpper) {
  const bool is_2d = a.size() == 3;
  const std::unique_ptr<ceres::CostFunction> cost(
      is_2d ? MakePoseError2d(root, edge) : MakePoseError3d(root, edge));
  const std::vector<const double*> parameters =
      is_2d ? std::vector<const double*>{a.data(), b.data()}
            : std::vector<const double*>{
                  a.data(), a.data() + 3, b.data(), b.data() + 3};
  Eigen::VectorXd error(cost->num_residuals());
  EXPECT_TRUE(cost->Evaluate(parameters.data(), error.data(), nullptr));
  return error;
}

const Pose kA2d = Pose2d(1.0, -2.0, 3.0);
const Pose kB2d = Pose2d(0.5, 2.5, -2.9);
const Pose kA3d = Pose3d({1.0, -2.0, 3.0}, {0.5, -0.7, 1.1});
const Pose kB3d = Pose3d({-0.3, 0.8, 2.0}, {-1.5, 0.2, 0.4});

TEST(PoseGraph, ExactMeasurementHasNoError) {
  EXPECT_LT(Error(EdgeOf(Relative(kA2d, kB2d)), kA2d, kB2d).norm(), 1e-13);
  EXPECT_LT(Error(EdgeOf(Relative(kA3d, kB3d)), kA3d, kB3d).norm(), 1e-13);
}

TEST(PoseGraph, WeightsByTheInformation) {
  PoseGraph::Edge edge = EdgeOf(Pose2d(0.0, 0.0, 0.0));
  // a is not turned: the error is b itself.
  const Pose a = Pose2d(0.0, 0.0, 0.0);
  const Pose b = Pose2d(1.0, 2.0, 0.5);
  const Eigen::Vector3d e(1.0, 2.0, 0.5);
  const double weighted = e.dot(edge.information * e);
  EXPECT_NEAR(Error(edge, a, b).squaredNorm(), weighted, 1e-12);
  // The other root is another cost, by more than rounding ...
  EXPECT_GT(std::abs(Error(edge, a, b, InformationRoot::kLower).squaredNorm() -
                     weighted),
            0.1);
  // ... unless the information is diagonal.
  edge.information = Eigen::Vector3d(4.0, 9.0, 16.0).asDiagonal();
  for (const auto root : {InformationRoot::kLower, InformationRoot::kUpper}) {
    EXPECT_LT((Error(edge, a, b, root) - Eigen::Vector3d(2.0, 6.0, 2.0)).norm(),
              1e-14);
  }
}

TEST(PoseGraph, ErrorOfASmallTurnIsTheTurn) {
  PoseGraph::Edge edge = EdgeOf(Pose3d({0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}));
  edge.information.setIdentity();
  const Eigen::VectorXd error =
      Error(edge, kA3d, kA3d);  // b = a where a turn of 0.3 was measured
  EXPECT_NEAR(error[3], 2.0 * std::sin(0.15), 1e-14);
  EXPECT_LT(error.tail<2>().norm() + error.head<3>().norm(), 1e-14);
}

TEST(PoseGraph, AnglesAreComparedOnTheCircle) {
  PoseGraph::Edge edge = EdgeOf(Pose2d(0.0, 0.0, 0.1));
  edge.information.setIdentity();
  const Pose a = Pose2d(0.0, 0.0, 3.1);
  const Pose b = Pose2d(0.0, 0.0, 3.15 - 2.0 * kPi);
  EXPECT_NEAR(Error(edge, a, b)[2], -0.05, 1e-14);
}

TEST(PoseGraph, MovingBothPosesChangesNothing) {
  const PoseGraph::Edge edge_2d = EdgeOf(Pose2d(1.0, 1.0, 1.0));
  const auto move_2d = [](const Pose& pose) {
    const Eigen::Vector2d moved =
        Eigen::Rotation2Dd(0.7) * Eigen::Vector2d(pose.head<2>());
    return Pose2d(moved[0] + 5.0, moved[1] - 3.0, pose[2] + 0.7);
  };
  EXPECT_LT((Error(edge_2d, kA2d, kB2d) -
             Error(edge_2d, move_2d(kA2d), move_2d(kB2d)))
                .norm(),
            1e-12);
  const PoseGraph::Edge edge_3d =
      EdgeOf(Pose3d({1.0, 1.0, 1.0}, {0.4, 0.5, 0.6}));
  const auto move_3d = [](const Pose& pose) {
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()));
    Pose moved(7);
    moved << turn * Eigen::Vector3d(pose.head<3>()) +
                 Eigen::Vector3d(5.0, -3.0, 2.0),
        (turn * Rotation(pose)).coeffs();
    return moved;
  };
  EXPECT_LT((Error(edge_3d, kA3d, kB3d) -
             Error(edge_3d, move_3d(kA3d), move_3d(kB3d)))
                .norm(),
            1e-12);
}

TEST(PoseGraph, HasTheRightDerivatives) {
  const std::unique_ptr<ceres::Manifold> pose(MakePoseManifold2d());
  const ceres::EigenQuaternionManifold quaternion;
  for (const auto root : {InformationRoot::kLower, InformationRoot::kUpper}) {
    ceres::GradientChecker::ProbeResults results;
    const std::unique_ptr<ceres::CostFunction> cost_2d(
        MakePoseError2d(root, EdgeOf(Pose2d(1.0, 1.0, 1.0))));
    const std::vector<const ceres::Manifold*> manifolds_2d = {pose.get(),
                                                              pose.get()};
    const double* poses_2d[] = {kA2d.data(), kB2d.data()};
    const ceres::GradientChecker checker_2d(
        cost_2d.get(), &manifolds_2d, ceres::NumericDiffOptions());
    // Ridders' differences are good to some 1e-9 here.
    EXPECT_TRUE(checker_2d.Probe(poses_2d, 1e-7, &results))
        << results.error_log;
    const std::unique_ptr<ceres::CostFunction> cost_3d(MakePoseError3d(
        root, EdgeOf(Pose3d({1.0, 1.0, 1.0}, {0.4, 0.5, 0.6}))));
    const std::vector<const ceres::Manifold*> manifolds_3d = {
        nullptr, &quaternion, nullptr, &quaternion};
    const double* poses_3d[] = {
        kA3d.data(), kA3d.data() + 3, kB3d.data(), kB3d.data() + 3};
    const ceres::GradientChecker checker_3d(
        cost_3d.get(), &manifolds_3d, ceres::NumericDiffOptions());
    EXPECT_TRUE(checker_3d.Probe(poses_3d, 1e-7, &results))
        << results.error_log;
  }
}

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

double Minimize(PoseGraph* graph) {
  ceres::Problem problem;
  AddPoseGraph(
      InformationRoot::kUpper, [] { return nullptr; }, graph, &problem);
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
