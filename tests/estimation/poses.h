// Poses and edges, for tests.
#ifndef INVGRAD_TESTS_ESTIMATION_POSES_H_
#define INVGRAD_TESTS_ESTIMATION_POSES_H_

#include <string>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "gtest/gtest.h"
#include "problems/estimation/g2o_file.h"

namespace invgrad {

inline constexpr double kPi = 3.14159265358979323846;

inline PoseGraph::Pose Pose2d(double x, double y, double theta) {
  PoseGraph::Pose pose(3);
  pose << x, y, theta;
  return pose;
}

inline PoseGraph::Pose Pose3d(const Eigen::Vector3d& position,
                              const Eigen::Vector3d& turn) {
  PoseGraph::Pose pose(7);
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  pose << position, rotation.coeffs();
  return pose;
}

inline Eigen::Quaterniond Rotation(const PoseGraph::Pose& pose) {
  return Eigen::Quaterniond(Eigen::Vector4d(pose.tail<4>()));
}

// b as a sees it.
inline PoseGraph::Pose Relative(const PoseGraph::Pose& a,
                                const PoseGraph::Pose& b) {
  if (a.size() == 3) {
    const Eigen::Vector2d step = Eigen::Rotation2Dd(-a[2]) * (b - a).head<2>();
    return Pose2d(step[0], step[1], b[2] - a[2]);
  }
  PoseGraph::Pose pose(7);
  pose << Rotation(a).conjugate() * Eigen::Vector3d((b - a).head<3>()),
      (Rotation(a).conjugate() * Rotation(b)).coeffs();
  return pose;
}

inline PoseGraph ParsedG2o(const std::string& text) {
  PoseGraph graph;
  std::string error;
  EXPECT_TRUE(ParseG2o(text, "f", &graph, &error)) << error;
  return graph;
}

inline PoseGraph::Edge EdgeOf(const PoseGraph::Pose& measurement) {
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

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ESTIMATION_POSES_H_
