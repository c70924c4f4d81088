// The cylinder of a published comparison: its points, its residuals, and what
// they say of a pose.
#include <cmath>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "problems/registration/cylinder.h"

namespace invgrad {
namespace registration_cylinder_test {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

TEST(Cylinder, HasHalfOfItsPointsOnTheWallAndHalfOnTheFloor) {
  const Matrix3Xd points = MakeCylinder(1);
  ASSERT_EQ(points.cols(), 7562);
  int num_wall = 0;
  double sum_z = 0.0;
  double sum_floor = 0.0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const double radius = points.col(i).head<2>().norm();
    if (points(2, i) == 0.0) {
      sum_floor += radius * radius;
      continue;
    }
    ++num_wall;
    sum_z += points(2, i);
    EXPECT_NEAR(radius, 40.0, 1e-12);
  }
  EXPECT_EQ(num_wall, 7562 / 2);
  // Uniform: means of 3,781 numbers with the deviations 5.8 and 462.
  EXPECT_NEAR(sum_z / num_wall, 10.0, 0.3);
  EXPECT_NEAR(sum_floor / num_wall, 800.0, 23.0);
  EXPECT_EQ(points, MakeCylinder(1));
  EXPECT_NE(points, MakeCylinder(2));
}

TEST(Cylinder, NoiseHasItsDeviation) {
  const Matrix3Xd points = MakeCylinder(1);
  const Matrix3Xd noise = WithNoise(points, 0.02, 7) - points;
  EXPECT_NEAR(std::sqrt(noise.squaredNorm() / noise.size()), 0.02, 4e-4);
  EXPECT_NEAR(noise.mean(), 0.0, 4e-4);
}

Isometry3d SomePose() {
  Vector6d step;
  step << 0.02, -0.03, 0.01, 0.002, -0.001, 0.003;
  return Moved(Isometry3d::Identity(), step);
}

TEST(Cylinder, MovedIsATranslationAndARotationInTheScansAxes) {
  Vector6d turn = Vector6d::Zero();
  turn[5] = M_PI / 2.0;
  const Isometry3d turned = Moved(Isometry3d::Identity(), turn);
  EXPECT_LT((turned * Vector3d::UnitX() - Vector3d::UnitY()).norm(), 1e-15);
  Vector6d step = Vector6d::Zero();
  step[0] = 1.0;         // in the target's axes
  step[3] = M_PI / 2.0;  // about the scan's x, which is the target's y
  const Isometry3d moved = Moved(turned, step);
  EXPECT_LT((moved.translation() - Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_LT((moved.linear() * Vector3d::UnitX() - Vector3d::UnitY()).norm(),
            1e-15);
  EXPECT_LT((moved.linear() * Vector3d::UnitY() - Vector3d::UnitZ()).norm(),
            1e-15);
  EXPECT_TRUE(Moved(turned, Vector6d::Zero()).isApprox(turned, 1e-15));
}

// A plane through the points near each point, so close to the plane that the
// weights are one: then the gradient is that of the cost. Its points must keep
// their neighbours.
TEST(LocalPlanes, GradientIsTheDerivativeOfTheCost) {
  Matrix3Xd target(3, 400);
  for (int i = 0; i < 400; ++i) {
    const double u = 0.3 * (i % 20);
    const double v = 0.3 * std::floor(i / 20.0);
    target.col(i) << u, v, 5.0 + 1e-3 * std::sin(3.0 * u) * v;
  }
  const LocalPlanes planes(target);
  const Matrix3Xd scan = target.middleCols(100, 200);
  Vector6d start;
  start << 0.04, 0.03, 1e-4, 1e-5, -2e-5, 1e-5;
  const Isometry3d pose = Moved(Isometry3d::Identity(), start);
  const LocalPlaneSums sums = planes.SumsAt(scan, pose);
  EXPECT_EQ(sums.num_points, 200);
  for (int i = 0; i < 6; ++i) {
    constexpr double kStep = 1e-7;
    const Vector6d h = kStep * Vector6d::Unit(i);
    const double difference = (planes.SumsAt(scan, Moved(pose, h)).cost -
                               planes.SumsAt(scan, Moved(pose, -h)).cost) /
                              (2.0 * kStep);
    // dr/dd = 1 - 1.8 |d|, where J has 1 - 0.9 |d|, with |d| below 2e-3.
    EXPECT_NEAR(sums.gradient[i],
                difference,
                2e-3 * sums.gradient.cwiseAbs().maxCoeff())
        << i;
  }
  EXPECT_LT((sums.H - sums.H.transpose()).norm(), 1e-12 * sums.H.norm());
}

// A plane has a trace of one a point in the translations, times the squared
// weight, and nothing to say of a motion along it.
TEST(LocalPlanes, APlaneDeterminesItsNormalAlone) {
  Matrix3Xd target(3, 400);
  for (int i = 0; i < 400; ++i) {
    target.col(i) << 0.3 * (i % 20), 0.3 * std::floor(i / 20.0), 5.0;
  }
  const Matrix3Xd scan = target.middleCols(100, 200);
  Vector6d start = Vector6d::Zero();
  start[2] = 0.1;
  const LocalPlaneSums sums =
      LocalPlanes(target).SumsAt(scan, Moved(Isometry3d::Identity(), start));
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  expected(2, 2) = 200 * 0.91 * 0.91;
  EXPECT_LT((sums.H.topLeftCorner<3, 3>() - expected).norm(), 1e-9);
  EXPECT_NEAR(sums.gradient[2], 200 * 0.91 * 0.091, 1e-9);
  EXPECT_NEAR(sums.cost, 100 * 0.091 * 0.091, 1e-9);
}

TEST(LocalPlanes, LeavesOutPlanesThroughTheOriginAndFarPoints) {
  Matrix3Xd target(3, 400);
  for (int i = 0; i < 400; ++i) {
    target.col(i) << 0.3 * (i % 20) - 3.0, 0.3 * std::floor(i / 20.0) - 3.0,
        0.0;
  }
  Matrix3Xd far = target;
  far.row(2).array() += 1.5;
  const LocalPlaneSums sums =
      LocalPlanes(target).SumsAt(far, Isometry3d::Identity());
  EXPECT_EQ(sums.num_points, 0);
  EXPECT_EQ(sums.H.norm(), 0.0);
  // On the floor itself a plane stands upright, if it stands at all.
  const LocalPlaneSums floor =
      LocalPlanes(target).SumsAt(target, Isometry3d::Identity());
  EXPECT_LT(floor.H(2, 2), 1e-20);
}

// Published for a cloud of this size: 1.5, 10.5, 28.9, 1801, 3386, 14672.
TEST(Cylinder, FirstHIsThatOfTheSource) {
  Isometry3d start = Isometry3d::Identity();
  start.translate(Vector3d(0.2, 0.8, 0.5));
  start.rotate(Eigen::AngleAxisd(2.0 * M_PI / 180.0, Vector3d::UnitZ()));
  const Matrix3Xd points = MakeCylinder(3);
  const LocalPlaneSums sums = LocalPlanes(points).SumsAt(points, start);
  const Vector6d values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(sums.H))
          .eigenvalues();
  Vector6d published;
  published << 1.5, 10.5, 28.9, 1801.0, 3386.0, 14672.0;
  for (int i = 0; i < 6; ++i) {
    EXPECT_GT(values[i], published[i] / 2.5) << i;
    EXPECT_LT(values[i], published[i] * 2.5) << i;
  }
}

// If scan and target have the same points, their normals have the same errors,
// and plain Gauss-Newton ends near the truth.
TEST(Cylinder, SameCloudsHaveTheSameErrors) {
  const Matrix3Xd points = MakeCylinder(3);
  const LocalPlanes planes(points);
  EXPECT_LT(planes.SumsAt(points, Isometry3d::Identity()).cost,
            planes.SumsAt(points, SomePose()).cost);
  const auto align = [&planes](const Matrix3Xd& scan) {
    Isometry3d pose = SomePose();
    for (int i = 0; i < 10; ++i) {
      const LocalPlaneSums sums = planes.SumsAt(scan, pose);
      pose = Moved(pose, -Eigen::MatrixXd(sums.H).llt().solve(sums.gradient));
    }
    return pose;
  };
  const Isometry3d same = align(points);
  EXPECT_LT(same.translation().head<2>().norm(), 0.02);
  EXPECT_LT(Eigen::AngleAxisd(same.linear()).angle(), 3e-3);
}

}  // namespace registration_cylinder_test
}  // namespace invgrad
