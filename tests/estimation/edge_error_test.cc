// The errors of edges, in pose_graph.h.

#include <cmath>
#include <memory>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Geometry"
#include "Eigen/LU"
#include "ceres/gradient_checker.h"
#include "gtest/gtest.h"
#include "problems/estimation/pose_graph.h"
#include "tests/estimation/poses.h"

namespace invgrad {
namespace edge_error_test {

using Pose = PoseGraph::Pose;

// `end`: of pose a's edge: a pose, a landmark, or nothing for a prior.
Eigen::VectorXd Error(const PoseGraph& graph,
                      const PoseGraph::Edge& edge,
                      const Pose& a,
                      const Pose& end,
                      EdgeError edge_error = EdgeError::kG2o) {
  const std::unique_ptr<ceres::CostFunction> cost(
      MakeEdgeError(graph, edge_error, edge));
  std::vector<const double*> parameters;
  for (const Pose* pose : {&a, &end}) {
    if (pose->size() > 0) parameters.push_back(pose->data());
    if (pose->size() == 7) parameters.push_back(pose->data() + 3);
  }
  EXPECT_EQ(cost->parameter_block_sizes().size(), parameters.size());
  Eigen::VectorXd error(cost->num_residuals());
  EXPECT_TRUE(cost->Evaluate(parameters.data(), error.data(), nullptr));
  return error;
}

PoseGraph GraphOf(int dimension) {
  PoseGraph graph;
  graph.dimension = dimension;
  return graph;
}

Eigen::VectorXd Error(const PoseGraph::Edge& edge,
                      const Pose& a,
                      const Pose& b,
                      EdgeError edge_error = EdgeError::kG2o) {
  return Error(GraphOf(a.size() == 3 ? 2 : 3), edge, a, b, edge_error);
}

constexpr EdgeError kEdgeErrors[] = {
    EdgeError::kG2o, EdgeError::kCeres, EdgeError::kCeresUpper};

const Pose kA2d = Pose2d(1.0, -2.0, 3.0);
const Pose kB2d = Pose2d(0.5, 2.5, -2.9);
const Pose kA3d = Pose3d({1.0, -2.0, 3.0}, {0.5, -0.7, 1.1});
const Pose kB3d = Pose3d({-0.3, 0.8, 2.0}, {-1.5, 0.2, 0.4});

TEST(EdgeError, ExactMeasurementHasNoError) {
  EXPECT_LT(Error(EdgeOf(Relative(kA2d, kB2d)), kA2d, kB2d).norm(), 1e-13);
  EXPECT_LT(Error(EdgeOf(Relative(kA3d, kB3d)), kA3d, kB3d).norm(), 1e-13);
}

TEST(EdgeError, WeightsByTheInformation) {
  PoseGraph::Edge edge = EdgeOf(Pose2d(0.0, 0.0, 0.0));
  // a is not turned: the error is b itself.
  const Pose a = Pose2d(0.0, 0.0, 0.0);
  const Pose b = Pose2d(1.0, 2.0, 0.5);
  const Eigen::Vector3d e(1.0, 2.0, 0.5);
  const double weighted = e.dot(edge.information * e);
  EXPECT_NEAR(Error(edge, a, b).squaredNorm(), weighted, 1e-12);
  EXPECT_NEAR(
      Error(edge, a, b, EdgeError::kCeresUpper).squaredNorm(), weighted, 1e-12);
  // The other root is another cost, by more than rounding ...
  EXPECT_GT(
      std::abs(Error(edge, a, b, EdgeError::kCeres).squaredNorm() - weighted),
      0.1);
  // ... unless the information is diagonal.
  edge.information = Eigen::Vector3d(4.0, 9.0, 16.0).asDiagonal();
  for (const EdgeError edge_error : kEdgeErrors) {
    EXPECT_LT(
        (Error(edge, a, b, edge_error) - Eigen::Vector3d(2.0, 6.0, 2.0)).norm(),
        1e-14);
  }
}

TEST(EdgeError, ErrorOfATurnIsThatOfItsQuaternion) {
  PoseGraph::Edge edge = EdgeOf(Pose3d({0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}));
  edge.information.setIdentity();
  // b = a where a turn of 0.3 was measured.
  const Eigen::VectorXd error = Error(edge, kA3d, kA3d);
  EXPECT_NEAR(error[3], -std::sin(0.15), 1e-14);
  EXPECT_LT(error.tail<2>().norm() + error.head<3>().norm(), 1e-14);
  // Of Ceres it is twice that, the other way round.
  const Eigen::VectorXd of_ceres = Error(edge, kA3d, kA3d, EdgeError::kCeres);
  EXPECT_NEAR(of_ceres[3], 2.0 * std::sin(0.15), 1e-14);
  EXPECT_LT(of_ceres.tail<2>().norm() + of_ceres.head<3>().norm(), 1e-14);
  // q and -q are one rotation.
  Pose other = kA3d;
  other.tail<4>() *= -1.0;
  EXPECT_LT((Error(edge, kA3d, other) - error).norm(), 1e-14);
}

// By homogeneous matrices.
Eigen::MatrixXd Matrix(const Pose& pose) {
  const Eigen::Index d = pose.size() == 3 ? 2 : 3;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(d + 1, d + 1);
  matrix.topRightCorner(d, 1) = pose.head(d);
  if (d == 2) {
    matrix.topLeftCorner(2, 2) = Eigen::Rotation2Dd(pose[2]).matrix();
  } else {
    matrix.topLeftCorner(3, 3) = Rotation(pose).matrix();
  }
  return matrix;
}

// Translation, then the angle, or vec(q) from the matrix's antisymmetric part
// and trace.
Eigen::VectorXd MatrixCoordinates(const Eigen::MatrixXd& M) {
  if (M.rows() == 3) {
    return Eigen::Vector3d(M(0, 2), M(1, 2), std::atan2(M(1, 0), M(0, 0)));
  }
  const double w = 0.5 * std::sqrt(M.topLeftCorner(3, 3).trace() + 1.0);
  Eigen::VectorXd coordinates(6);
  coordinates << M.topRightCorner(3, 1), (M(2, 1) - M(1, 2)) / (4.0 * w),
      (M(0, 2) - M(2, 0)) / (4.0 * w), (M(1, 0) - M(0, 1)) / (4.0 * w);
  return coordinates;
}

Eigen::MatrixXd RootOf(const PoseGraph::Edge& edge) {
  return Eigen::MatrixXd(edge.information).llt().matrixU();
}

// A graph with two offsets, and its edges of every kind.
struct EveryEdge {
  PoseGraph graph;
  PoseGraph::Edge relative, prior, landmark;
  Pose a, b, point;
};

EveryEdge EveryEdgeOf(int dimension) {
  EveryEdge every;
  const bool is_2d = dimension == 2;
  every.a = is_2d ? kA2d : kA3d;
  every.b = is_2d ? kB2d : kB3d;
  every.graph.dimension = dimension;
  every.graph.offsets = {
      {4, is_2d ? Pose2d(0.3, -0.2, 0.5) : Pose3d({0.3, -0.2, 0.1}, {0, 1, 0})},
      {2,
       is_2d ? Pose2d(-0.1, 0.7, 2.0)
             : Pose3d({-0.1, 0.7, 0.4}, {0.5, 0.2, -1.0})}};
  const Pose measured =
      is_2d ? Pose2d(1.0, 1.5, 0.4) : Pose3d({1.0, 1.5, 2.0}, {0.4, 0.5, 0.6});
  every.relative = EdgeOf(measured);
  every.relative.offset_from = 0;
  every.relative.offset_to = 1;
  every.prior = EdgeOf(measured);
  every.prior.kind = PoseGraph::EdgeKind::kPrior;
  every.prior.offset_from = 1;
  every.landmark.kind = PoseGraph::EdgeKind::kLandmark;
  every.landmark.offset_from = 0;
  every.landmark.measurement = Eigen::VectorXd::LinSpaced(dimension, 1.0, 3.0);
  every.landmark.information =
      EdgeOf(measured).information.topLeftCorner(dimension, dimension);
  every.point = Eigen::VectorXd::LinSpaced(dimension, 5.0, 4.0);
  return every;
}

TEST(EdgeError, ErrorsAreThoseOfHomogeneousMatrices) {
  for (const int dimension : {2, 3}) {
    const EveryEdge every = EveryEdgeOf(dimension);
    const Eigen::MatrixXd A = Matrix(every.a);
    const Eigen::MatrixXd B = Matrix(every.b);
    const Eigen::MatrixXd P0 = Matrix(every.graph.offsets[0].pose);
    const Eigen::MatrixXd P1 = Matrix(every.graph.offsets[1].pose);
    const Eigen::MatrixXd Z = Matrix(every.relative.measurement);
    EXPECT_LT((Error(every.graph, every.relative, every.a, every.b) -
               RootOf(every.relative) *
                   MatrixCoordinates(Z.inverse() * (A * P0).inverse() * B * P1))
                  .norm(),
              1e-13);
    EXPECT_LT((Error(every.graph, every.prior, every.a, {}) -
               RootOf(every.prior) * MatrixCoordinates(Z.inverse() * A * P1))
                  .norm(),
              1e-13);
    const Eigen::VectorXd seen =
        (A * P0).inverse() * Eigen::VectorXd(every.point).homogeneous();
    EXPECT_LT((Error(every.graph, every.landmark, every.a, every.point) -
               RootOf(every.landmark) *
                   (seen.head(dimension) - every.landmark.measurement))
                  .norm(),
              1e-13);
  }
}

TEST(EdgeError, AnglesAreComparedOnTheCircle) {
  PoseGraph::Edge edge = EdgeOf(Pose2d(0.0, 0.0, 0.1));
  edge.information.setIdentity();
  const Pose a = Pose2d(0.0, 0.0, 3.1);
  const Pose b = Pose2d(0.0, 0.0, 3.15 - 2.0 * kPi);
  EXPECT_NEAR(Error(edge, a, b)[2], -0.05, 1e-14);
}

TEST(EdgeError, MovingBothPosesChangesNothing) {
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

// Of the parameter blocks of a pose, a pose and a landmark, or a pose.
void ExpectRightDerivatives(const PoseGraph& graph,
                            EdgeError edge_error,
                            const PoseGraph::Edge& edge,
                            const std::vector<const Pose*>& ends) {
  const std::unique_ptr<ceres::Manifold> pose(MakePoseManifold2d());
  const ceres::EigenQuaternionManifold quaternion;
  const std::unique_ptr<ceres::CostFunction> cost(
      MakeEdgeError(graph, edge_error, edge));
  std::vector<const ceres::Manifold*> manifolds;
  std::vector<const double*> values;
  for (const Pose* end : ends) {
    const bool is_point = end->size() == graph.dimension;
    const bool is_2d = graph.dimension == 2;
    values.push_back(end->data());
    manifolds.push_back(is_2d && !is_point ? pose.get() : nullptr);
    if (is_2d || is_point) continue;
    values.push_back(end->data() + 3);
    manifolds.push_back(&quaternion);
  }
  const ceres::GradientChecker checker(
      cost.get(), &manifolds, ceres::NumericDiffOptions());
  // Ridders' differences are good to some 1e-9 here.
  ceres::GradientChecker::ProbeResults results;
  EXPECT_TRUE(checker.Probe(values.data(), 1e-7, &results))
      << results.error_log;
}

TEST(EdgeError, HasTheRightDerivatives) {
  for (const int dimension : {2, 3}) {
    SCOPED_TRACE(dimension);
    EveryEdge every = EveryEdgeOf(dimension);
    ExpectRightDerivatives(
        every.graph, EdgeError::kG2o, every.relative, {&every.a, &every.b});
    ExpectRightDerivatives(
        every.graph, EdgeError::kG2o, every.prior, {&every.a});
    ExpectRightDerivatives(
        every.graph, EdgeError::kG2o, every.landmark, {&every.a, &every.point});
    every.relative.offset_from = every.relative.offset_to = -1;
    for (const EdgeError edge_error : kEdgeErrors) {
      ExpectRightDerivatives(
          every.graph, edge_error, every.relative, {&every.a, &every.b});
    }
  }
}

// Only differences of positions count.
TEST(EdgeError, ErrorsFarFromTheOriginAreExact) {
  const PoseGraph::Edge edge = EdgeOf(Pose2d(1.0, 1.0, 1.0));
  const auto far = [](const Pose& pose) {
    return Pose2d(pose[0] + 0x1p30, pose[1] - 0x1p31, pose[2]);
  };
  EXPECT_LT(
      (Error(edge, kA2d, kB2d) - Error(edge, far(kA2d), far(kB2d))).norm(),
      1e-13);
}

}  // namespace edge_error_test
}  // namespace invgrad
