#include "problems/estimation/pose_graph.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "Eigen/Cholesky"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/autodiff_manifold.h"
#include "ceres/product_manifold.h"
#include "glog/logging.h"

namespace invgrad {

namespace {

constexpr double kHalfTurn = 3.14159265358979323846;

// The same angle in [-pi, pi).
template <typename T>
T NormalizeAngle(const T& angle) {
  using std::floor;
  return angle -
         2.0 * kHalfTurn * floor((angle + kHalfTurn) / (2.0 * kHalfTurn));
}

template <int kSize>
Eigen::Matrix<double, kSize, kSize> Weights(InformationRoot root,
                                            const PoseGraph::Edge& edge) {
  CHECK_EQ(edge.information.rows(), kSize);
  const Eigen::Matrix<double, kSize, kSize> information = edge.information;
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> cholesky(information);
  CHECK(cholesky.info() == Eigen::Success)
      << "the information of an edge is not positive definite";
  if (root == InformationRoot::kLower) return cholesky.matrixL();
  return cholesky.matrixU();
}

struct PoseError2d {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  Eigen::Vector3d measurement;
  Eigen::Matrix3d weights;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    using std::cos;
    using std::sin;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    const T c = cos(a[2]);
    const T s = sin(a[2]);
    const Eigen::Matrix<T, 3, 1> error(
        c * dx + s * dy - measurement[0],
        c * dy - s * dx - measurement[1],
        NormalizeAngle(T(b[2] - a[2] - measurement[2])));
    Eigen::Map<Eigen::Matrix<T, 3, 1>> weighted(residual);
    weighted = weights.lazyProduct(error);
    return true;
  }
};

struct PoseError3d {
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  Eigen::Vector3d position;
  Eigen::Quaterniond rotation;
  Eigen::Matrix<double, 6, 6> weights;

  template <typename T>
  bool operator()(const T* p_a,
                  const T* q_a,
                  const T* p_b,
                  const T* q_b,
                  T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    using Quaternion = Eigen::Quaternion<T>;
    const Quaternion to_a = Eigen::Map<const Quaternion>(q_a).conjugate();
    const Quaternion q_ab = to_a * Eigen::Map<const Quaternion>(q_b);
    const Vector step =
        Eigen::Map<const Vector>(p_b) - Eigen::Map<const Vector>(p_a);
    Eigen::Matrix<T, 6, 1> error;
    error.template head<3>() = to_a * step - position.cast<T>();
    error.template tail<3>() =
        2.0 * (rotation.cast<T>() * q_ab.conjugate()).vec();
    Eigen::Map<Eigen::Matrix<T, 6, 1>> weighted(residual);
    weighted = weights.lazyProduct(error);
    return true;
  }
};

struct AngleManifold {
  template <typename T>
  bool Plus(const T* x, const T* delta, T* x_plus_delta) const {
    *x_plus_delta = NormalizeAngle(T(*x + *delta));
    return true;
  }
  template <typename T>
  bool Minus(const T* y, const T* x, T* y_minus_x) const {
    *y_minus_x = NormalizeAngle(T(*y - *x));
    return true;
  }
};

std::vector<int> ConstantPoses(const PoseGraph& graph) {
  return graph.fixed.empty() ? std::vector<int>{0} : graph.fixed;
}

}  // namespace

ceres::CostFunction* MakePoseError2d(InformationRoot root,
                                     const PoseGraph::Edge& edge) {
  auto* error = new PoseError2d;
  error->measurement = edge.measurement;
  error->weights = Weights<3>(root, edge);
  return new ceres::AutoDiffCostFunction<PoseError2d, 3, 3, 3>(error);
}

ceres::CostFunction* MakePoseError3d(InformationRoot root,
                                     const PoseGraph::Edge& edge) {
  auto* error = new PoseError3d;
  error->position = edge.measurement.head<3>();
  error->rotation.coeffs() = edge.measurement.tail<4>();
  error->weights = Weights<6>(root, edge);
  return new ceres::AutoDiffCostFunction<PoseError3d, 6, 3, 4, 3, 4>(error);
}

ceres::Manifold* MakePoseManifold2d() {
  using Angle = ceres::AutoDiffManifold<AngleManifold, 1, 1>;
  return new ceres::ProductManifold<ceres::EuclideanManifold<2>, Angle>;
}

void AddPoseGraph(InformationRoot root,
                  const MakeLossFunction& make_loss,
                  PoseGraph* graph,
                  ceres::Problem* problem) {
  CHECK(graph->dimension == 2 || graph->dimension == 3) << graph->dimension;
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
  for (const PoseGraph::Edge& edge : graph->edges) {
    double* a = graph->poses.col(edge.from).data();
    double* b = graph->poses.col(edge.to).data();
    if (graph->dimension == 2) {
      problem->AddResidualBlock(MakePoseError2d(root, edge), make_loss(), a, b);
    } else {
      problem->AddResidualBlock(
          MakePoseError3d(root, edge), make_loss(), a, a + 3, b, b + 3);
    }
  }
  for (const int j : ConstantPoses(*graph)) {
    double* pose = graph->poses.col(j).data();
    problem->SetParameterBlockConstant(pose);
    if (graph->dimension == 3) problem->SetParameterBlockConstant(pose + 3);
  }
}

void PerturbPoseGraph(double sigma, NumpyRandom* random, PoseGraph* graph) {
  const std::vector<int> constant = ConstantPoses(*graph);
  for (Eigen::Index j = 0; j < graph->poses.cols(); ++j) {
    if (std::find(constant.begin(), constant.end(), j) != constant.end()) {
      continue;
    }
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
}

}  // namespace invgrad
