#include "problems/estimation/pose_graph.h"

#include <algorithm>
#include <vector>

#include "Eigen/Geometry"
#include "ceres/autodiff_manifold.h"
#include "ceres/product_manifold.h"
#include "glog/logging.h"

namespace invgrad {

namespace {

// Small steps do not wrap the angle: Ceres takes x - Plus(x, -gradient) for the
// gradient, which would be 2 pi at a heading of pi.
struct AngleManifold {
  template <typename T>
  bool Plus(const T* x, const T* delta, T* x_plus_delta) const {
    constexpr double kSmall = 0.1;
    const bool is_small = *delta > T(-kSmall) && *delta < T(kSmall);
    const T sum = *x + *delta;
    *x_plus_delta = is_small ? sum : NormalizeAngle(sum);
    return true;
  }
  template <typename T>
  bool Minus(const T* y, const T* x, T* y_minus_x) const {
    *y_minus_x = NormalizeAngle(T(*y - *x));
    return true;
  }
};

bool Contains(const std::vector<int>& columns, Eigen::Index j) {
  return std::find(columns.begin(), columns.end(), j) != columns.end();
}

void AddBlocks(PoseGraph* graph, ceres::Problem* problem) {
  for (Eigen::Index j = 0; j < graph->poses.cols(); ++j) {
    double* pose = graph->poses.col(j).data();
    if (graph->dimension == 2) {
      problem->AddParameterBlock(pose, 3, MakePoseManifold2d());
    } else {
      problem->AddParameterBlock(pose, 3);
      problem->AddParameterBlock(
          pose + 3, 4, new ceres::EigenQuaternionManifold);
    }
  }
  for (Eigen::Index j = 0; j < graph->landmarks.cols(); ++j) {
    problem->AddParameterBlock(graph->landmarks.col(j).data(),
                               graph->dimension);
  }
  for (const int j : ConstantPoses(*graph)) {
    double* pose = graph->poses.col(j).data();
    problem->SetParameterBlockConstant(pose);
    if (graph->dimension == 3) problem->SetParameterBlockConstant(pose + 3);
  }
  for (const int j : graph->fixed_landmarks) {
    problem->SetParameterBlockConstant(graph->landmarks.col(j).data());
  }
}

}  // namespace

std::vector<int> ConstantPoses(const PoseGraph& graph) {
  const bool is_held =
      !graph.fixed.empty() || !graph.fixed_landmarks.empty() ||
      std::any_of(graph.edges.begin(), graph.edges.end(), [](const auto& edge) {
        return edge.kind == PoseGraph::EdgeKind::kPrior;
      });
  return is_held ? graph.fixed : std::vector<int>{0};
}

ceres::Manifold* MakePoseManifold2d() {
  using Angle = ceres::AutoDiffManifold<AngleManifold, 1, 1>;
  return new ceres::ProductManifold<ceres::EuclideanManifold<2>, Angle>;
}

void AddPoseGraph(EdgeError edge_error,
                  const MakeLossFunction& make_loss,
                  PoseGraph* graph,
                  ceres::Problem* problem) {
  CHECK(graph->dimension == 2 || graph->dimension == 3) << graph->dimension;
  AddBlocks(graph, problem);
  for (const PoseGraph::Edge& edge : graph->edges) {
    std::vector<double*> blocks;
    const auto add_pose = [&](int j) {
      double* pose = graph->poses.col(j).data();
      blocks.push_back(pose);
      if (graph->dimension == 3) blocks.push_back(pose + 3);
    };
    add_pose(edge.from);
    if (edge.kind == PoseGraph::EdgeKind::kRelative) add_pose(edge.to);
    if (edge.kind == PoseGraph::EdgeKind::kLandmark) {
      blocks.push_back(graph->landmarks.col(edge.to).data());
    }
    problem->AddResidualBlock(
        MakeEdgeError(*graph, edge_error, edge), make_loss(), blocks);
  }
}

void PerturbPoseGraph(double sigma, NumpyRandom* random, PoseGraph* graph) {
  const std::vector<int> constant = ConstantPoses(*graph);
  for (Eigen::Index j = 0; j < graph->poses.cols(); ++j) {
    if (Contains(constant, j)) continue;
    auto pose = graph->poses.col(j);
    if (graph->dimension == 2) {
      pose += sigma * random->Normal(3);
      pose[2] = NormalizeAngle(pose[2]);
      continue;
    }
    pose.head<3>() += sigma * random->Normal(3);
    const Eigen::Vector3d turn = sigma * random->Normal(3);
    const double angle = turn.norm();
    const Eigen::Quaterniond rotation(
        Eigen::Quaterniond(pose.tail<4>()) *
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn.normalized())));
    pose.tail<4>() = rotation.normalized().coeffs();
  }
  for (Eigen::Index j = 0; j < graph->landmarks.cols(); ++j) {
    if (Contains(graph->fixed_landmarks, j)) continue;
    graph->landmarks.col(j) += sigma * random->Normal(graph->dimension);
  }
}

}  // namespace invgrad
