#include "problems/registration/scan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/random.h"

namespace invgrad {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = 3.14159265358979323846 / 180.0;
constexpr int kNumAzimuths = 60;
constexpr int kNumElevations = 24;
constexpr double kMinRange = 0.5;
constexpr double kMaxRange = 15.0;

std::vector<Scene> MakeScenes() {
  const Vector3d x = Vector3d::UnitX();
  const Vector3d y = Vector3d::UnitY();
  const Vector3d z = Vector3d::UnitZ();
  Scene room;
  room.name = "room";
  room.walls = {{x, 12.0}, {-x, 3.0}, {y, 4.0}, {-y, 4.0}, {z, 2.0}, {-z, 1.0}};
  Scene corridor;
  corridor.name = "corridor";
  corridor.walls = {{y, 1.2}, {-y, 1.2}, {z, 1.5}, {-z, 1.0}};
  corridor.is_undetermined[0] = true;
  Scene tunnel;
  tunnel.name = "tunnel";
  tunnel.walls = {{-z, 1.0}};
  tunnel.radius = 2.0;
  tunnel.is_undetermined[0] = true;
  Scene plane;
  plane.name = "plane";
  plane.walls = {{-z, 1.5}};
  for (const int i : {0, 1, 5}) plane.is_undetermined[i] = true;
  Scene cylinder;
  cylinder.name = "cylinder";
  cylinder.radius = 2.0;
  cylinder.swings = false;
  for (const int i : {0, 3}) cylinder.is_undetermined[i] = true;
  return {room, corridor, tunnel, plane, cylinder};
}

}  // namespace

double Scene::Range(const Vector3d& origin, const Vector3d& direction) const {
  double range = std::numeric_limits<double>::infinity();
  for (const Wall& wall : walls) {
    const double speed = wall.normal.dot(direction);
    if (speed > 0.0) {
      range =
          std::min(range, (wall.distance - wall.normal.dot(origin)) / speed);
    }
  }
  const double a = direction.tail<2>().squaredNorm();
  if (radius > 0.0 && a > 0.0) {
    // The positive root of a t^2 + 2 b t + c, c < 0 inside.
    const double b = direction.tail<2>().dot(origin.tail<2>());
    const double c = origin.tail<2>().squaredNorm() - radius * radius;
    range = std::min(range, (std::sqrt(b * b - a * c) - b) / a);
  }
  return range;
}

const std::vector<Scene>& Scenes() {
  static const auto& scenes = *new std::vector<Scene>(MakeScenes());
  return scenes;
}

Eigen::Isometry3d PathPose(const Scene& scene, int k) {
  constexpr double kAdvance = 0.1;
  const double swing = scene.swings ? std::sin(0.2 * k) : 0.0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(
      Vector3d(kAdvance * k, 0.2 * swing, scene.swings ? 0.02 * swing : 0.0));
  pose.rotate(Eigen::AngleAxisd(0.1 * std::sin(0.13 * k) * scene.swings,
                                Vector3d::UnitZ()));
  // The heading against the scene's axes.
  pose.rotate(Eigen::AngleAxisd(20.0 * kDegree, Vector3d::UnitZ()));
  return pose;
}

Eigen::Matrix3Xd MakeScan(const Scene& scene,
                          const Eigen::Isometry3d& pose,
                          const ScanOptions& options,
                          std::uint32_t seed) {
  NumpyGenerator random(seed);
  Eigen::Matrix3Xd points(3, kNumAzimuths * kNumElevations);
  int num_points = 0;
  for (int i = 0; i < kNumElevations; ++i) {
    const double elevation =
        (-60.0 + 100.0 * i / (kNumElevations - 1)) * kDegree;
    for (int j = 0; j < kNumAzimuths; ++j) {
      const double azimuth = 360.0 * j / kNumAzimuths * kDegree;
      const Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth),
                               std::sin(elevation));
      double range =
          scene.Range(pose.translation(), pose.linear() * direction) +
          options.noise * random.StandardNormal();
      if (random.Random() < options.outliers) {
        range = kMaxRange * random.Random();
      }
      if (range > kMinRange && range < kMaxRange) {
        points.col(num_points++) = options.unit * range * direction;
      }
    }
  }
  points.conservativeResize(3, num_points);
  return points;
}

}  // namespace invgrad
