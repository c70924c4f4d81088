#include "problems/registration/alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "Eigen/Eigenvalues"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "problems/registration/point_tree.h"

namespace invgrad {
namespace {

using Eigen::Vector3d;

constexpr int kNumNeighbors = 8;
constexpr double kFlat = 0.2;  // spread along the normal / the second one
constexpr double kMaxDistance = 0.5;  // of a point and its match [m]
constexpr double kMinSpread = 0.005;  // allowed along a normal, at least [m]
constexpr double kStartError = 0.05;  // of a point at the start [m]

struct PointToPlane {
  template <typename T>
  bool operator()(const T* t, const T* q, T* r) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(t);
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q);
    const Eigen::Matrix<T, 3, 1> moved =
        rotation * point.cast<T>() + translation - match.cast<T>();
    r[0] = normal.cast<T>().dot(moved);
    return true;
  }
  Vector3d point, match, normal;
};

}  // namespace

AlignmentTarget::AlignmentTarget(Eigen::Matrix3Xd points,
                                 const AlignmentOptions& options)
    : points_(std::move(points)),
      options_(options),
      tree_(std::make_unique<PointTree>(points_)) {
  FindNormals();
}

AlignmentTarget::~AlignmentTarget() = default;

void AlignmentTarget::FindNormals() {
  const double max_spread =
      options_.guards_edges
          ? std::max(kMinSpread, 2.0 * options_.noise) * options_.unit
          : std::numeric_limits<double>::infinity();
  normals_.setZero(3, points_.cols());
  double sum = 0.0;
  int num_normals = 0;
  for (Eigen::Index i = 0; i < points_.cols(); ++i) {
    std::array<std::size_t, kNumNeighbors> found{};
    std::array<double, kNumNeighbors> distances{};
    if (tree_->Nearest(points_.col(i), &found, &distances) < kNumNeighbors) {
      continue;
    }
    Eigen::Matrix<double, 3, kNumNeighbors> near;
    for (int k = 0; k < kNumNeighbors; ++k) near.col(k) = points_.col(found[k]);
    near.colwise() -= near.rowwise().mean().eval();
    const Eigen::Matrix3d covariance = near * near.transpose() / kNumNeighbors;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
    const Vector3d variances = axes.eigenvalues().cwiseMax(0.0);
    if (variances[0] > kFlat * kFlat * variances[1] || variances[1] == 0.0 ||
        variances[0] > max_spread * max_spread) {
      continue;
    }
    normals_.col(i) = axes.eigenvectors().col(0);
    sum += variances[0] / ((kNumNeighbors - 3) * variances[1]);
    ++num_normals;
  }
  if (num_normals > 0) normal_error_ = std::sqrt(sum / num_normals);
}

int AlignmentTarget::AddResiduals(const Eigen::Matrix3Xd& scan,
                                  RelativePose* pose,
                                  ceres::Problem* problem) const {
  problem->AddParameterBlock(pose->t.data(), 3);
  problem->AddParameterBlock(
      pose->q.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
  const double max_distance = kMaxDistance * options_.unit;
  const double max_residual =
      (kStartError + 5.0 * options_.noise) * options_.unit;
  int num_residuals = 0;
  for (Eigen::Index i = 0; i < scan.cols(); ++i) {
    std::array<std::size_t, 1> found{};
    std::array<double, 1> distance{};
    const Vector3d moved = pose->q * scan.col(i) + pose->t;
    if (tree_->Nearest(moved, &found, &distance) < 1 ||
        distance[0] > max_distance * max_distance ||
        normals_.col(found[0]).isZero(0.0)) {
      continue;
    }
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<PointToPlane, 1, 3, 4>(new PointToPlane{
            scan.col(i), points_.col(found[0]), normals_.col(found[0])}),

        options_.guards_edges
            ? static_cast<ceres::LossFunction*>(
                  new ceres::TukeyLoss(max_residual))
            : new ceres::HuberLoss(kStartError * options_.unit),
        pose->t.data(),
        pose->q.coeffs().data());
    ++num_residuals;
  }
  return num_residuals;
}

}  // namespace invgrad
