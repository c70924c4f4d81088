// Alignments of two scans: known motions, derivatives, what is left alone, and
// units.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Dense"
#include "ceres/gradient_checker.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "problems/registration/alignment.h"
#include "problems/registration/scan.h"
#include "tests/problems/registration_scenes.h"

namespace invgrad {
namespace registration_alignment_test {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

RelativePose PoseOf(const Vector3d& t, const Vector3d& rotation) {
  RelativePose pose;
  pose.t = t;
  pose.q = Eigen::AngleAxisd(rotation.norm(), rotation.stableNormalized());
  return pose;
}

// A start 2 cm and 5 mrad off.
RelativePose StartNear(const Isometry3d& truth, double unit = 1.0) {
  RelativePose start =
      PoseOf(unit * Vector3d(0.01, -0.014, 0.01), {0.003, 0.003, -0.003});
  start.t += unit * truth.translation();
  start.q = start.q * Eigen::Quaterniond(truth.linear());
  return start;
}

double Angle(const RelativePose& pose, const Isometry3d& truth) {
  return pose.q.angularDistance(Eigen::Quaterniond(truth.linear()));
}

// Ten times: the matches, and ceres::Solve, with proposals of `rule` alone if
// there is one.
void Align(const AlignmentTarget& target,
           const Matrix3Xd& scan,
           UpdateRule* rule,
           RelativePose* pose) {
  for (int i = 0; i < 10; ++i) {
    ceres::Problem problem;
    ASSERT_GT(target.AddResiduals(scan, pose, &problem), 100);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = ceres::DENSE_QR;
    ceres::Solver::Summary summary;
    std::unique_ptr<UpdateCallback> callback;
    if (rule != nullptr) {
      UpdateCallback::Options callback_options;
      callback_options.only_proposals = true;
      callback =
          std::make_unique<UpdateCallback>(rule, &problem, callback_options);
      callback->AddTo(&options);
    }
    ceres::Solve(options, &problem, &summary);
  }
}

struct Pair {
  Matrix3Xd target, scan;
  Isometry3d truth;  // of the scan, relative to the target
  Isometry3d frame;  // of the target in the scene
};

Pair MakePair(const Scene& scene, const ScanOptions& options) {
  Pair pair;
  pair.frame = PathPose(scene, 10);
  const Isometry3d here = PathPose(scene, 11);
  pair.truth = pair.frame.inverse() * here;
  pair.target = MakeScan(scene, pair.frame, options, 1);
  pair.scan = MakeScan(scene, here, options, 2);
  return pair;
}

// The same points in another frame: at the true motion every residual is zero.
TEST(RegistrationAlignment, TheSamePointsGiveTheMotionToAllDigits) {
  const Scene& room = SceneOf("room");
  const Matrix3Xd points = MakeScan(room, PathPose(room, 10), ScanOptions(), 1);
  Isometry3d truth = Isometry3d::Identity();
  truth.translate(Vector3d(0.1, -0.05, 0.02));
  truth.rotate(Eigen::AngleAxisd(0.05, Vector3d(1.0, 2.0, 3.0).normalized()));
  const Matrix3Xd scan =
      truth.inverse().linear() * (points.colwise() - truth.translation());
  const AlignmentTarget target(points, AlignmentOptions());
  RelativePose pose = StartNear(truth);
  Align(target, scan, nullptr, &pose);
  EXPECT_LT((pose.t - truth.translation()).norm(), 1e-9);
  EXPECT_LT(Angle(pose, truth), 1e-9);
}

// Two scans of the path. With noise each direction has the deviation
// (2^(1/2) 0.01 m) / lambda^(1/2) of H's eigenvalue lambda, of which the least
// is 78, and of the rotations 4,000 m^2; without, some matches near edges are
// wrong.
TEST(RegistrationAlignment, FindsTheMotionInTheRoom) {
  for (const bool is_noisy : {false, true}) {
    const Pair pair =
        MakePair(SceneOf("room"), is_noisy ? ScanOptions() : Exact());
    const AlignmentTarget target(pair.target, AlignmentOptions());
    RelativePose pose = StartNear(pair.truth);
    Align(target, pair.scan, nullptr, &pose);
    EXPECT_LT((pose.t - pair.truth.translation()).norm(),
              is_noisy ? 0.008 : 0.002);
    EXPECT_LT(Angle(pose, pair.truth), is_noisy ? 0.0015 : 0.0005);
  }
}

// The pattern of rays moves with the sensor, and what is wrong near edges moves
// with it: the motion found is too short, by the same part in each alignment.
TEST(RegistrationAlignment, UnguardedEdgesPullTowardsNoMotion) {
  const Pair pair = MakePair(SceneOf("room"), Exact());
  double errors[2];
  for (const bool guards_edges : {false, true}) {
    AlignmentOptions options;
    options.guards_edges = guards_edges;
    const AlignmentTarget target(pair.target, options);
    RelativePose pose = StartNear(pair.truth);
    Align(target, pair.scan, nullptr, &pose);
    errors[guards_edges] =
        (pair.frame.linear() * (pose.t - pair.truth.translation())).x();
  }
  EXPECT_LT(errors[false], -1e-3);
  EXPECT_LT(std::abs(errors[true]), -0.5 * errors[false]);
}

// But for the few whose neighbours are on two walls, within 5 mm of a plane.
TEST(RegistrationAlignment, NormalsAreThoseOfTheWalls) {
  for (const Scene& scene : Scenes()) {
    if (scene.radius > 0.0) continue;
    const Isometry3d frame = PathPose(scene, 10);
    const AlignmentTarget target(MakeScan(scene, frame, Exact(), 1),
                                 AlignmentOptions());
    int num_normals = 0, num_right = 0;
    for (const Vector3d normal : target.normals().colwise()) {
      if (normal.isZero(0.0)) continue;
      ++num_normals;
      EXPECT_NEAR(normal.norm(), 1.0, 1e-12);
      double largest_cosine = 0.0;
      for (const Scene::Wall& wall : scene.walls) {
        largest_cosine = std::max(
            largest_cosine, std::abs(wall.normal.dot(frame.linear() * normal)));
      }
      if (largest_cosine > 1.0 - 1e-12) ++num_right;
    }
    EXPECT_GT(num_normals, 500) << scene.name;
    EXPECT_GT(num_right, 0.95 * num_normals) << scene.name;
    if (scene.name == "plane") {
      EXPECT_EQ(num_right, num_normals);
      EXPECT_LT(target.normal_error(), 1e-12);
    }
  }
}

// On a plane all normals are known. The estimate is that of the tangent
// direction with the smaller spread, so it is rather too large.
TEST(RegistrationAlignment, EstimatesTheErrorOfTheNormals) {
  const Scene& plane = SceneOf("plane");
  ScanOptions options;
  options.outliers = 0.0;
  const AlignmentTarget target(MakeScan(plane, PathPose(plane, 10), options, 1),
                               AlignmentOptions());
  double sum = 0.0;
  int num_normals = 0;
  for (const Vector3d normal : target.normals().colwise()) {
    if (normal.isZero(0.0)) continue;
    sum += normal.head<2>().squaredNorm() / 2.0;
    ++num_normals;
  }
  const double error = std::sqrt(sum / num_normals);
  EXPECT_GT(num_normals, 300);
  EXPECT_GT(target.normal_error(), error);
  EXPECT_LT(target.normal_error(), 1.5 * error);
}

TEST(RegistrationAlignment, JacobiansAreThoseOfFiniteDifferences) {
  const Pair pair = MakePair(SceneOf("room"), ScanOptions());
  const AlignmentTarget target(pair.target, AlignmentOptions());
  RelativePose pose = StartNear(pair.truth);
  ceres::Problem problem;
  target.AddResiduals(pair.scan, &pose, &problem);
  std::vector<ceres::ResidualBlockId> blocks;
  problem.GetResidualBlocks(&blocks);
  const ceres::EigenQuaternionManifold quaternion;
  const std::vector<const ceres::Manifold*> manifolds = {nullptr, &quaternion};
  for (size_t i = 0; i < blocks.size(); i += 50) {
    ceres::GradientChecker checker(
        problem.GetCostFunctionForResidualBlock(blocks[i]),
        &manifolds,
        ceres::NumericDiffOptions());
    std::vector<double*> parameters;
    problem.GetParameterBlocksForResidualBlock(blocks[i], &parameters);
    ceres::GradientChecker::ProbeResults results;
    EXPECT_TRUE(checker.Probe(parameters.data(), 1e-6, &results))
        << results.error_log;
  }
}

// The start is 15 mm off along the axis and 13 mm across. Without noise the
// normals are exact but near edges.
TEST(RegistrationAlignment, TheCorridorsAxisStaysAtItsStart) {
  for (const bool is_noisy : {false, true}) {
    const Pair pair =
        MakePair(SceneOf("corridor"), is_noisy ? ScanOptions() : Exact());
    const AlignmentTarget target(pair.target, AlignmentOptions());
    const RelativePose start = StartNear(pair.truth);
    RelativePose pose = start;
    const auto rule = MakeRule("determined:groups=blocks:truncation=0.1");
    Align(target, pair.scan, rule.get(), &pose);
    EXPECT_EQ(rule->LastStepReport().substr(0, 17), "1 of 6 left alone")
        << rule->LastStepReport();
    const Vector3d motion = pair.frame.linear() * (pose.t - start.t);
    EXPECT_LT(std::abs(motion.x()), is_noisy ? 1e-3 : 1e-4);
    const Vector3d error =
        pair.frame.linear() * (pose.t - pair.truth.translation());
    EXPECT_LT(error.tail<2>().norm(), is_noisy ? 3e-3 : 3e-4);
    // LM follows what edges and noise say about the axis.
    RelativePose by_lm = start;
    Align(target, pair.scan, nullptr, &by_lm);
    const Vector3d lm_motion = pair.frame.linear() * (by_lm.t - start.t);
    EXPECT_GT(std::abs(lm_motion.x()), 5e-3);
  }
}

TEST(RegistrationAlignment, MetresAndMillimetresGiveTheSameMotion) {
  for (const Scene& scene : Scenes()) {
    RelativePose poses[2];
    for (const bool in_millimetres : {false, true}) {
      ScanOptions options;
      options.unit = in_millimetres ? 1000.0 : 1.0;
      const Pair pair = MakePair(scene, options);
      AlignmentOptions alignment;
      alignment.unit = options.unit;
      const AlignmentTarget target(pair.target, alignment);
      RelativePose& pose = poses[in_millimetres];
      pose = StartNear(pair.truth, options.unit);
      const auto rule = MakeRule("determined:groups=blocks:truncation=0.1");
      Align(target, pair.scan, rule.get(), &pose);
      pose.t /= options.unit;
    }
    EXPECT_LT((poses[0].t - poses[1].t).norm(), 1e-9) << scene.name;
    EXPECT_LT(poses[0].q.angularDistance(poses[1].q), 1e-7) << scene.name;
  }
}

TEST(RegistrationAlignment, HasNoResidualsWhereNothingIsNear) {
  const Pair pair = MakePair(SceneOf("room"), ScanOptions());
  const auto count = [&pair](const Matrix3Xd& target, const Vector3d& t) {
    RelativePose pose = PoseOf(t, Vector3d::Zero());
    ceres::Problem problem;
    return AlignmentTarget(target, AlignmentOptions())
        .AddResiduals(pair.scan, &pose, &problem);
  };
  EXPECT_GT(count(pair.target, pair.truth.translation()), 500);
  EXPECT_EQ(count(pair.target, Vector3d(100.0, 0.0, 0.0)), 0);
  // Too few for a plane, or none at all.
  EXPECT_EQ(count(pair.target.leftCols(7), pair.truth.translation()), 0);
  EXPECT_EQ(count(Matrix3Xd(3, 0), pair.truth.translation()), 0);
  EXPECT_EQ(AlignmentTarget(Matrix3Xd(3, 0), AlignmentOptions()).normal_error(),
            0.0);
}

}  // namespace registration_alignment_test
}  // namespace invgrad
