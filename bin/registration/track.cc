#include "bin/registration/track.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "Eigen/Dense"
#include "ceres/problem.h"
#include "invgrad/determined_step.h"
#include "invgrad/random.h"
#include "problems/registration/alignment.h"
#include "report/interrupt.h"

namespace invgrad {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

RelativePose Odometry(const Isometry3d& truth,
                      double unit,
                      std::uint32_t seed) {
  constexpr double kPositionNoise = 0.005;  // [m]
  constexpr double kAngleNoise = 0.001;     // [rad]
  NumpyGenerator random(seed);
  const Vector3d position_noise = random.StandardNormal(3, 1);
  const Vector3d angle_noise = random.StandardNormal(3, 1);
  const Vector3d angle = kAngleNoise * angle_noise;
  RelativePose pose;
  pose.t = unit * (truth.translation() + kPositionNoise * position_noise);
  pose.q = Eigen::AngleAxisd(angle.norm(), angle.normalized()) *
           Eigen::Quaterniond(truth.linear());
  return pose;
}

Isometry3d InMetres(const RelativePose& pose, double unit) {
  Isometry3d in_metres = Isometry3d::Identity();
  in_metres.translate(pose.t / unit);
  in_metres.rotate(pose.q);
  return in_metres;
}

// In the axes of `frame`.
Vector6d ErrorOf(const Isometry3d& pose,
                 const Isometry3d& truth,
                 const Isometry3d& frame) {
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(pose.linear() * truth.linear().transpose()));
  Vector6d error;
  error.head<3>() = frame.linear() * (pose.translation() - truth.translation());
  error.tail<3>() = frame.linear() * (turn.angle() * turn.axis());
  return error;
}

// Not less than the default, because edges and curvature make errors of normals
// that do not shrink with the noise, and that the estimate does not see: of
// scans without noise the corridor's axis has s = 0.008 s_max, and the roll in
// the cylinder 0.07.
double TauOf(double normal_error) {
  return std::max(DeterminedStepOptions().tau,
                  DeterminedStepOptions::TauForNormals(normal_error));
}

}  // namespace

Track TrackScans(const Scene& scene,
                 const RegistrationMethod& method,
                 const TrackOptions& options) {
  constexpr int kNumMatchings = 10;
  const double unit = options.scan.unit;
  const AlignmentOptions alignment = {
      options.scan.noise, unit, options.guards_edges};
  const auto scan_seed = [&options](int k) {
    return 100000u * options.seed + 2u * static_cast<std::uint32_t>(k);
  };
  Isometry3d last = PathPose(scene, 0);
  auto target = std::make_unique<AlignmentTarget>(
      MakeScan(scene, last, options.scan, scan_seed(0)), alignment);
  Track track;
  track.scans.emplace_back().pose = last;
  track.normal_error = target->normal_error();
  const std::unique_ptr<UpdateRule> rule = MakeRegistrationRule(
      method, options.tau > 0.0 ? options.tau : TauOf(track.normal_error));
  const bool is_odometry = method.kind == RegistrationMethod::Kind::kOdometry;

  Vector6d sum = Vector6d::Zero();
  for (int k = 1; k <= options.num_scans && !Interrupt::IsRequested(); ++k) {
    const Isometry3d here = PathPose(scene, k);
    const Isometry3d truth = last.inverse() * here;
    Eigen::Matrix3Xd scan = MakeScan(scene, here, options.scan, scan_seed(k));
    RelativePose pose = Odometry(truth, unit, scan_seed(k) + 1);
    for (int i = 0; i < kNumMatchings && !is_odometry; ++i) {
      ceres::Problem problem;
      if (target->AddResiduals(scan, &pose, &problem) == 0) break;
      SolveAlignment(rule.get(), &problem);
    }
    const Isometry3d found = InMetres(pose, unit);
    sum += ErrorOf(found, truth, last);
    TrackedScan tracked;
    tracked.pose = track.scans.back().pose * found;
    tracked.num_left_alone = NumLeftAlone(method, rule.get());
    for (const bool is_undetermined : {false, true}) {
      Vector6d part = sum;
      for (int i = 0; i < 6; ++i) {
        if (scene.is_undetermined[i] != is_undetermined) part[i] = 0.0;
      }
      tracked.position_drift[is_undetermined] = part.head<3>().norm();
      tracked.rotation_drift[is_undetermined] = part.tail<3>().norm();
    }
    track.scans.push_back(tracked);
    track.is_finite = track.is_finite && sum.allFinite();
    last = here;
    target = std::make_unique<AlignmentTarget>(std::move(scan), alignment);
  }
  return track;
}

}  // namespace invgrad
