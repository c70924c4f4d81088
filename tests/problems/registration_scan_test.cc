// Scans of scenes with known geometry: closed forms, noise, and which motions
// of the sensor change them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "problems/registration/scan.h"
#include "tests/problems/registration_scenes.h"

namespace invgrad {
namespace registration_scan_test {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

constexpr int kNumRays = 60 * 24;
// Ranges are at most 15, and of a few rounding errors.
constexpr double kRounding = 1e-12;

// The distance of a place in the scene to the nearest surface.
double DistanceToSurface(const Scene& scene, const Vector3d& place) {
  double distance = std::numeric_limits<double>::infinity();
  for (const Scene::Wall& wall : scene.walls) {
    distance =
        std::min(distance, std::abs(wall.normal.dot(place) - wall.distance));
  }
  if (scene.radius > 0.0) {
    distance =
        std::min(distance, std::abs(place.tail<2>().norm() - scene.radius));
  }
  return distance;
}

TEST(RegistrationScan, RangesAreThoseOfTheClosedForms) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Vector3d center = Vector3d::Zero();
  for (const double angle : {0.1, 0.5, 1.0, 1.5}) {
    const Vector3d sideways(std::cos(angle), std::sin(angle), 0.0);
    EXPECT_NEAR(SceneOf("corridor").Range(center, sideways),
                1.2 / std::sin(angle),
                kRounding * 1.2 / std::sin(angle));
    EXPECT_NEAR(SceneOf("cylinder").Range(center, sideways),
                2.0 / std::sin(angle),
                kRounding * 2.0 / std::sin(angle));
    EXPECT_EQ(SceneOf("plane").Range(center, sideways), infinity);
  }
  EXPECT_EQ(SceneOf("plane").Range(center, -Vector3d::UnitZ()), 1.5);
  EXPECT_EQ(SceneOf("corridor").Range(center, Vector3d::UnitX()), infinity);
  EXPECT_EQ(SceneOf("cylinder").Range(center, Vector3d::UnitX()), infinity);
  EXPECT_EQ(SceneOf("room").Range(center, -Vector3d::UnitX()), 3.0);
  // Off the axis; down there is the floor.
  const Vector3d high(5.0, 0.0, 0.5);
  EXPECT_DOUBLE_EQ(SceneOf("tunnel").Range(high, Vector3d::UnitZ()), 1.5);
  EXPECT_DOUBLE_EQ(SceneOf("tunnel").Range(high, -Vector3d::UnitZ()), 1.5);
  EXPECT_DOUBLE_EQ(SceneOf("cylinder").Range(high, -Vector3d::UnitZ()), 2.5);
  EXPECT_DOUBLE_EQ(SceneOf("cylinder").Range(high, Vector3d::UnitY()),
                   std::sqrt(4.0 - 0.25));
}

TEST(RegistrationScan, PointsAreOnTheSurfaces) {
  for (const Scene& scene : Scenes()) {
    for (const int k : {0, 37, 100}) {
      const Isometry3d pose = PathPose(scene, k);
      const Matrix3Xd points = MakeScan(scene, pose, Exact(), 1);
      EXPECT_GT(points.cols(), kNumRays / 3) << scene.name;
      for (const Vector3d point : points.colwise()) {
        EXPECT_LT(DistanceToSurface(scene, pose * point), kRounding)
            << scene.name;
        EXPECT_GT(point.norm(), 0.5);
        EXPECT_LT(point.norm(), 15.0);
      }
    }
  }
}

// In the room all rays return, so that scans have their points in common.
TEST(RegistrationScan, NoiseIsAlongTheRaysAndHasItsDeviation) {
  const Scene& room = SceneOf("room");
  const Isometry3d pose = PathPose(room, 0);
  const Matrix3Xd exact = MakeScan(room, pose, Exact(), 1);
  ASSERT_EQ(exact.cols(), kNumRays);
  ScanOptions options = Exact();
  options.noise = 0.02;
  const Matrix3Xd noisy = MakeScan(room, pose, options, 1);
  ASSERT_EQ(noisy.cols(), kNumRays);
  const Eigen::RowVectorXd error =
      noisy.colwise().norm() - exact.colwise().norm();
  for (int i = 0; i < kNumRays; ++i) {
    EXPECT_LT(noisy.col(i).cross(exact.col(i)).norm(), 1e-10);
  }
  // Five standard errors of the mean and of the standard deviation.
  const double deviation = std::sqrt(error.squaredNorm() / kNumRays);
  EXPECT_LT(std::abs(error.mean()), 5.0 * 0.02 / std::sqrt(1.0 * kNumRays));
  EXPECT_NEAR(deviation, 0.02, 5.0 * 0.02 / std::sqrt(2.0 * kNumRays));
}

TEST(RegistrationScan, OutliersAreAShareOfTheRays) {
  const Scene& room = SceneOf("room");
  const Isometry3d pose = PathPose(room, 0);
  ScanOptions options = Exact();
  options.outliers = 0.2;
  const Matrix3Xd points = MakeScan(room, pose, options, 1);
  int num_outliers = 0;
  for (const Vector3d point : points.colwise()) {
    if (DistanceToSurface(room, pose * point) > kRounding) ++num_outliers;
  }
  // Ranges below 0.5 of 15 are left out.
  const double expected = 0.2 * 14.5 / 15.0 * kNumRays;
  EXPECT_NEAR(num_outliers, expected, 5.0 * std::sqrt(0.8 * expected));
  EXPECT_GE(points.cols() - num_outliers, 0.75 * kNumRays);
}

TEST(RegistrationScan, IsTheSameForTheSameSeed) {
  const ScanOptions options;
  for (const Scene& scene : Scenes()) {
    const Isometry3d pose = PathPose(scene, 5);
    const Matrix3Xd points = MakeScan(scene, pose, options, 7);
    EXPECT_EQ(points, MakeScan(scene, pose, options, 7));
    const Matrix3Xd other = MakeScan(scene, pose, options, 8);
    EXPECT_TRUE(other.cols() != points.cols() || other != points);
    ScanOptions in_millimetres;
    in_millimetres.unit = 1000.0;
    const Matrix3Xd large = MakeScan(scene, pose, in_millimetres, 7);
    ASSERT_EQ(large.cols(), points.cols());
    EXPECT_LT((large / 1000.0 - points).cwiseAbs().maxCoeff(), kRounding);
  }
}

// The largest change of a range, if the sensor moves along an axis of the scene
// by 1 cm, or turns about it by 10 mrad. Rays that return nothing count with
// the largest range.
double LargestChange(const Scene& scene, int axis) {
  const Isometry3d pose = PathPose(scene, 0);
  Isometry3d moved = pose;
  const Vector3d direction = Vector3d::Unit(axis % 3);
  if (axis < 3) {
    moved.pretranslate(0.01 * direction);
  } else {
    moved.linear() =
        Eigen::AngleAxisd(0.01, direction).toRotationMatrix() * pose.linear();
  }
  double change = 0.0;
  for (int i = 0; i < 100; ++i) {
    const double azimuth = 0.7 * i;
    const double elevation = 0.6 * std::sin(1.3 * i);
    const Vector3d ray(std::cos(azimuth) * std::cos(elevation),
                       std::sin(azimuth) * std::cos(elevation),
                       std::sin(elevation));
    const auto range = [&](const Isometry3d& at) {
      return std::min(scene.Range(at.translation(), at.linear() * ray), 15.0);
    };
    change = std::max(change, std::abs(range(pose) - range(moved)));
  }
  return change;
}

TEST(RegistrationScan, UndeterminedMotionsChangeNoRange) {
  for (const Scene& scene : Scenes()) {
    for (int axis = 0; axis < 6; ++axis) {
      const double change = LargestChange(scene, axis);
      if (scene.is_undetermined[axis]) {
        EXPECT_LT(change, kRounding) << scene.name << " " << axis;
      } else {
        EXPECT_GT(change, 1e-3) << scene.name << " " << axis;
      }
    }
  }
}

TEST(RegistrationScan, ThePathAdvancesAndStaysInside) {
  for (const Scene& scene : Scenes()) {
    for (int k = 0; k <= 100; ++k) {
      const Vector3d place = PathPose(scene, k).translation();
      EXPECT_NEAR(place.x(), 0.1 * k, kRounding);
      for (const Scene::Wall& wall : scene.walls) {
        EXPECT_LT(wall.normal.dot(place), wall.distance - 0.5);
      }
    }
  }
  // In the cylinder the sensor stays on the axis.
  for (const int k : {1, 50}) {
    EXPECT_TRUE(
        PathPose(SceneOf("cylinder"), k).translation().tail<2>().isZero(0.0));
  }
}

}  // namespace registration_scan_test
}  // namespace invgrad
