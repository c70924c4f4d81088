#include "problems/registration/cylinder.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "Eigen/Dense"
#include "invgrad/random.h"
#include "problems/registration/point_tree.h"

namespace invgrad {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr int kNumCylinderPoints = 7562;
constexpr double kRadius = 40.0;
constexpr double kHeight = 20.0;
constexpr int kNumPlanePoints = 5;
constexpr double kSearchRadius = 1.0;
constexpr double kMaxThickness = 0.2;
constexpr double kMinWeight = 0.1;

// n . q + offset = 0 for q on the plane.
struct Plane {
  Vector3d normal;
  double offset;
};

bool FitPlane(const Eigen::Matrix<double, kNumPlanePoints, 3>& points,
              Plane* plane) {
  using Vector = Eigen::Matrix<double, kNumPlanePoints, 1>;
  const Vector3d a = points.colPivHouseholderQr().solve(Vector::Constant(-1.0));
  const double length = a.norm();
  if (!(length > 1e-6)) return false;  // farther than 1e6 from the origin
  *plane = {a / length, 1.0 / length};
  const Vector distances = (points * plane->normal).array() + plane->offset;
  return distances.cwiseAbs().maxCoeff() < kMaxThickness;
}

}  // namespace

Matrix3Xd MakeCylinder(std::uint32_t seed) {
  NumpyGenerator random(seed);
  Matrix3Xd points(3, kNumCylinderPoints);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const bool is_wall = i % 2 == 0;
    const double angle = 2.0 * M_PI * random.Random();
    const double place = random.Random();
    const double radius = is_wall ? kRadius : kRadius * std::sqrt(place);
    points.col(i) << radius * std::cos(angle), radius * std::sin(angle),
        is_wall ? kHeight * place : 0.0;
  }
  return points;
}

Matrix3Xd WithNoise(const Matrix3Xd& points, double noise, std::uint32_t seed) {
  NumpyGenerator random(seed);
  return points +
         noise * random.StandardNormal(3, static_cast<int>(points.cols()));
}

LocalPlanes::LocalPlanes(Matrix3Xd target)
    : target_(std::move(target)), tree_(std::make_unique<PointTree>(target_)) {}

LocalPlanes::~LocalPlanes() = default;

LocalPlaneSums LocalPlanes::SumsAt(const Matrix3Xd& scan,
                                   const Isometry3d& pose) const {
  LocalPlaneSums sums;
  for (Eigen::Index i = 0; i < scan.cols(); ++i) {
    const Vector3d point = scan.col(i);
    const Vector3d moved = pose * point;
    std::array<std::size_t, kNumPlanePoints> found{};
    std::array<double, kNumPlanePoints> distances{};
    if (tree_->Nearest(moved, &found, &distances) < kNumPlanePoints ||
        distances.back() > kSearchRadius * kSearchRadius) {
      continue;
    }
    Eigen::Matrix<double, kNumPlanePoints, 3> near;
    for (int k = 0; k < kNumPlanePoints; ++k) {
      near.row(k) = target_.col(found[k]).transpose();
    }
    Plane plane;
    if (!FitPlane(near, &plane)) continue;
    const double distance = plane.normal.dot(moved) + plane.offset;
    const double weight = 1.0 - 0.9 * std::abs(distance);
    if (weight <= kMinWeight) continue;
    Eigen::Matrix<double, 6, 1> row;
    row << plane.normal, point.cross(pose.linear().transpose() * plane.normal);
    row *= weight;
    const double residual = weight * distance;
    sums.H += row * row.transpose();
    sums.gradient += residual * row;
    sums.cost += 0.5 * residual * residual;
    ++sums.num_points;
  }
  return sums;
}

Isometry3d Moved(const Isometry3d& pose,
                 const Eigen::Matrix<double, 6, 1>& step) {
  const Vector3d turn = step.tail<3>();
  Isometry3d moved = pose;
  moved.rotate(Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()));
  moved.pretranslate(Vector3d(step.head<3>()));
  return moved;
}

}  // namespace invgrad
