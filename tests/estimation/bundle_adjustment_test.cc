#include "problems/estimation/bundle_adjustment.h"

#include <cmath>
#include <memory>
#include <vector>

#include "ceres/gradient_checker.h"
#include "ceres/rotation.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {
namespace bundle_adjustment_test {

using Camera = Eigen::Matrix<double, 9, 1>;

Eigen::Vector2d Error(const Camera& camera,
                      const Eigen::Vector3d& point,
                      const Eigen::Vector2d& pixel = Eigen::Vector2d::Zero()) {
  const std::unique_ptr<ceres::CostFunction> cost(
      MakeReprojectionError(pixel[0], pixel[1]));
  const double* parameters[] = {camera.data(), point.data()};
  Eigen::Vector2d error;
  EXPECT_TRUE(cost->Evaluate(parameters, error.data(), nullptr));
  return error;
}

Camera TurnedCamera() {
  Camera camera;
  camera << 0.1, -0.2, 0.3, 0.4, 0.5, -0.6, 500.0, 0.1, -0.02;
  return camera;
}

// Points around (0, 0, -10), seen without error.
BalData ExactData(int num_cameras, int num_points) {
  NumpyRandom random(3);
  BalData data;
  data.points = 4.0 * random.Rand(3, num_points);
  data.points.array() -= 2.0;
  data.points.row(2).array() -= 10.0;
  data.cameras = 0.2 * random.Rand(9, num_cameras);
  data.cameras.row(6).setConstant(500.0);
  data.cameras.bottomRows(2) *= 0.1;
  for (int i = 0; i < num_cameras; ++i) {
    for (int j = 0; j < num_points; ++j) {
      const Eigen::Vector2d pixel =
          Error(data.cameras.col(i), data.points.col(j));
      data.observations.push_back({i, j, pixel[0], pixel[1]});
    }
  }
  return data;
}

MakeLossFunction NoLoss() {
  return [] { return nullptr; };
}

TEST(BundleAdjustment, ProjectsAsPublished) {
  Camera camera = Camera::Zero();
  camera[6] = 100.0;
  const Eigen::Vector3d point(1.0, 2.0, -4.0);
  // p = -(1, 2) / -4
  EXPECT_LT(
      (Error(camera, point, {20.0, 45.0}) - Eigen::Vector2d(5.0, 5.0)).norm(),
      1e-13);
  camera[7] = 0.5;
  camera[8] = 0.25;
  const double square = 0.25 * 0.25 + 0.5 * 0.5;
  const double scale = 1.0 + 0.5 * square + 0.25 * square * square;
  EXPECT_LT((Error(camera, point) - scale * Eigen::Vector2d(25.0, 50.0)).norm(),
            1e-13);
  camera[5] = -4.0;  // twice as far
  camera.tail<2>().setZero();
  EXPECT_LT((Error(camera, point) - Eigen::Vector2d(12.5, 25.0)).norm(), 1e-13);
}

TEST(BundleAdjustment, HasTheRightDerivatives) {
  const std::unique_ptr<ceres::CostFunction> cost(
      MakeReprojectionError(3.0, -4.0));
  const Camera camera = TurnedCamera();
  const Eigen::Vector3d point(1.0, 2.0, -7.0);
  const double* parameters[] = {camera.data(), point.data()};
  const std::vector<const ceres::Manifold*> euclidean = {nullptr, nullptr};
  const ceres::GradientChecker checker(
      cost.get(), &euclidean, ceres::NumericDiffOptions());
  ceres::GradientChecker::ProbeResults results;
  // Ridders' differences are good to some 1e-9 here.
  EXPECT_TRUE(checker.Probe(parameters, 1e-7, &results)) << results.error_log;
}

TEST(BundleAdjustment, SizeOfTheSceneCannotBeSeen) {
  Camera camera = TurnedCamera();
  const Eigen::Vector3d point(1.0, 2.0, -7.0);
  const Eigen::Vector2d before = Error(camera, point);
  camera.segment<3>(3) *= 8.0;
  EXPECT_LT((Error(camera, 8.0 * point) - before).norm(),
            1e-12 * before.norm());
}

TEST(BundleAdjustment, CameraSeesItsCenterAtTheOrigin) {
  const Camera camera = TurnedCamera();
  const Eigen::Vector3d center = CameraCenter(camera);
  Eigen::Vector3d seen;
  ceres::AngleAxisRotatePoint(camera.data(), center.data(), seen.data());
  EXPECT_LT((seen + camera.segment<3>(3)).norm(), 1e-15);
}

TEST(BundleAdjustment, FindsExactDataAgain) {
  const BalData exact = ExactData(3, 20);
  BalData data = exact;
  NumpyRandom random(1);
  PerturbBundleAdjustment(0.01, &random, &data);
  ceres::Problem problem;
  AddBundleAdjustment(NoLoss(), &data, &problem);
  EXPECT_EQ(problem.NumResidualBlocks(), 60);
  EXPECT_EQ(problem.NumParameterBlocks(), 23);
  EXPECT_EQ(problem.NumParameters(), 3 * 9 + 20 * 3);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.linear_solver_ordering = PointsFirst(&data);
  EXPECT_EQ(options.linear_solver_ordering->GroupSize(0), 20);
  EXPECT_EQ(options.linear_solver_ordering->GroupSize(1), 3);
  options.function_tolerance = 1e-16;
  options.max_num_iterations = 200;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  // Pixels are off by some 10 at first: 120 residuals, half their squares.
  EXPECT_GT(summary.initial_cost, 100.0);
  EXPECT_LT(summary.final_cost, 1e-12 * summary.initial_cost);
}

TEST(BundleAdjustment, NoiseIsAsLargeAsItSays) {
  BalData data;
  data.points.resize(3, 4000);
  // On a line, at -2000 ... 1999: the median distance to the middle is 1000.
  for (int j = 0; j < 4000; ++j) data.points.col(j) << j - 2000, 0.0, 0.0;
  data.cameras = TurnedCamera().replicate(1, 2000);
  const BalData before = data;
  NumpyRandom random(1);
  PerturbBundleAdjustment(0.02, &random, &data);
  // The mean square of 12,000 and of 6,000 normal numbers is known to some 2 %.
  EXPECT_NEAR((data.points - before.points).norm() / std::sqrt(12000.0),
              0.02 * 1000.0,
              0.02 * 1000.0 * 0.05);
  EXPECT_NEAR(
      (data.cameras - before.cameras).topRows(3).norm() / std::sqrt(6000.0),
      0.02,
      0.02 * 0.05);
  double sum = 0.0;
  for (int j = 0; j < 2000; ++j) {
    sum += (CameraCenter(data.cameras.col(j)) -
            CameraCenter(before.cameras.col(j)))
               .squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(sum / 6000.0), 20.0, 1.0);
  EXPECT_EQ(data.cameras.bottomRows(3), before.cameras.bottomRows(3));
}

}  // namespace bundle_adjustment_test
}  // namespace invgrad
