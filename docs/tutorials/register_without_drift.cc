// A laser scanner moves along a corridor, whose walls do not show how far.
// Aligns two scans by Levenberg-Marquardt and by steps that leave alone what
// the walls do not determine.
//
// Sample runs:
//
//   build/release/bin/register_without_drift
//   build/release/bin/register_without_drift --length=8 --seed=3
//
// docs/tutorials/register_without_drift.md explains each part.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "invgrad/determined_step.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

DEFINE_double(length,
              0.0,
              "of the corridor, a wall at its end [m]; 0: it has no end");
DEFINE_int32(seed, 1, "of the noise");

namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int kNumAzimuths = 60;
constexpr int kNumElevations = 24;
constexpr double kMaxRange = 15.0;    // [m]
constexpr double kNoise = 0.01;       // of a range [m]
constexpr double kMaxResidual = 0.1;  // of a match on the same wall [m]

// A point of each ray, in the scanner's frame; none beyond the range.
using Scan = std::array<std::array<std::optional<Vector3d>, kNumAzimuths>,
                        kNumElevations>;

// The corridor: 2.4 m wide, 2.5 m high, along x.
double Range(const Vector3d& origin, const Vector3d& ray) {
  std::vector<std::pair<Vector3d, double>> walls = {{Vector3d::UnitY(), 1.2},
                                                    {-Vector3d::UnitY(), 1.2},
                                                    {Vector3d::UnitZ(), 1.5},
                                                    {-Vector3d::UnitZ(), 1.0}};
  if (FLAGS_length > 0.0) walls.push_back({Vector3d::UnitX(), FLAGS_length});
  double range = kMaxRange;
  for (const auto& [normal, distance] : walls) {
    const double speed = normal.dot(ray);
    if (speed > 0.0) {
      range = std::min(range, (distance - normal.dot(origin)) / speed);
    }
  }
  return range;
}

Scan MakeScan(const Isometry3d& pose, invgrad::NumpyGenerator* random) {
  Scan scan;
  for (int i = 0; i < kNumElevations; ++i) {
    for (int j = 0; j < kNumAzimuths; ++j) {
      const double elevation = -1.0 + 1.7 * i / (kNumElevations - 1);
      const double azimuth = 2.0 * M_PI * j / kNumAzimuths;
      const Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                         std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation));
      const double range = Range(pose.translation(), pose.linear() * ray);
      const double measured = range + kNoise * random->StandardNormal();
      if (range < kMaxRange) scan[i][j] = measured * ray;
    }
  }
  return scan;
}

// [match]
// A point p of the scan, and the plane through q with the normal n of the scan
// before it.
struct Match {
  Vector3d p, q, n;
};

// Matches points of the same ray. Normals are those of the four neighbours, and
// *normal_error is their error in an angle, root mean square [rad].
std::vector<Match> MatchRays(const Scan& before,
                             const Scan& scan,
                             double* normal_error) {
  std::vector<Match> matches;
  double sum = 0.0;
  for (int i = 1; i + 1 < kNumElevations; ++i) {
    for (int j = 0; j < kNumAzimuths; ++j) {
      const auto& left = before[i][(j + kNumAzimuths - 1) % kNumAzimuths];
      const auto& right = before[i][(j + 1) % kNumAzimuths];
      const auto& down = before[i - 1][j];
      const auto& up = before[i + 1][j];
      const auto& q = before[i][j];
      const auto& p = scan[i][j];
      if (!left || !right || !down || !up || !q || !p) continue;
      const Vector3d along = *right - *left;
      const Vector3d across = *up - *down;
      const Vector3d n = along.cross(across).normalized();
      // The neighbours and the point are on one wall.
      const Vector3d center = (*left + *right + *up + *down) / 4.0;
      if (std::abs(n.dot(*left + *right - *up - *down)) > 4.0 * kNoise ||
          std::abs(n.dot(*q - center)) > 2.0 * kNoise) {
        continue;
      }
      matches.push_back({*p, *q, n});
      sum += kNoise * kNoise *
             (1.0 / along.squaredNorm() + 1.0 / across.squaredNorm());
    }
  }
  *normal_error = std::sqrt(sum / std::max<size_t>(matches.size(), 1));
  return matches;
}
// [/match]

// [residual]
struct PointToPlane {
  template <typename T>
  bool operator()(const T* t, const T* q, T* r) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(t);
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q);
    const Eigen::Matrix<T, 3, 1> moved =
        rotation * match.p.cast<T>() + translation - match.q.cast<T>();
    r[0] = match.n.cast<T>().dot(moved);
    return true;
  }
  Match match;
};

struct Pose {
  Vector3d t;
  Eigen::Quaterniond q;
};

void AddAlignment(const std::vector<Match>& matches,
                  Pose* pose,
                  ceres::Problem* problem) {
  for (const Match& match : matches) {
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<PointToPlane, 1, 3, 4>(
            new PointToPlane{match}),
        new ceres::TukeyLoss(kMaxResidual),
        pose->t.data(),
        pose->q.coeffs().data());
  }
  problem->SetManifold(pose->q.coeffs().data(),
                       new ceres::EigenQuaternionManifold);
}
// [/residual]

// [callback]
// ceres::Solve by steps of the rule alone. Returns what was left alone.
std::string SolveByRule(double tau, ceres::Problem* problem) {
  const std::unique_ptr<invgrad::UpdateRule> rule = invgrad::MakeRule(
      "determined:groups=blocks:truncation=" + std::to_string(tau));
  invgrad::UpdateCallback::Options callback_options;
  callback_options.only_proposals = true;
  invgrad::UpdateCallback callback(rule.get(), problem, callback_options);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  return rule->LastStepReport();
}
// [/callback]

// [loop]
// The same without Ceres, for a registration that has a loop of its own.
bool AlignInALoop(const std::vector<Match>& matches,
                  double tau,
                  Pose* pose,
                  std::string* report) {
  invgrad::DeterminedStepOptions options;
  options.tau = tau;
  options.group_sizes = {3, 3};  // translation, rotation
  invgrad::DeterminedStep determined(options);
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Match& match : matches) {
      const Vector3d turned = pose->q * match.p;
      const double r = match.n.dot(turned + pose->t - match.q);
      if (std::abs(r) > kMaxResidual) continue;
      Eigen::Matrix<double, 6, 1> row;
      row << match.n, turned.cross(match.n);
      H += row * row.transpose();
      gradient += row * r;
    }
    invgrad::DeterminedStep::Vector step;
    std::string error;
    if (!determined.Compute(H, gradient, &step, &error)) {
      std::fprintf(stderr, "%s\n", error.c_str());
      return false;
    }
    const Vector3d turn = step.tail<3>();
    pose->t += step.head<3>();
    pose->q = Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()) * pose->q;
  }
  *report = determined.Report();
  return true;
}
// [/loop]

// Errors in the corridor's axes.
void Print(const char* name,
           const Pose& pose,
           const Isometry3d& truth,
           const Isometry3d& before) {
  const Vector3d error =
      1e3 * (before.linear() * (pose.t - truth.translation()));
  std::printf("%-20s along %6.1f mm, across %4.1f mm, %4.2f mrad\n",
              name,
              error.x(),
              error.tail<2>().norm(),
              1e3 * pose.q.angularDistance(Eigen::Quaterniond(truth.linear())));
}

}  // namespace

int main(int argc, char** argv) {
  gflags::ParseCommandLineFlags(&argc, &argv, true);

  // [scene]
  // 20 degrees askew in the corridor, and then 10 cm further.
  invgrad::NumpyGenerator random(FLAGS_seed);
  Isometry3d before = Isometry3d::Identity();
  before.rotate(Eigen::AngleAxisd(0.35, Vector3d::UnitZ()));
  Isometry3d truth = Isometry3d::Identity();
  truth.translate(before.linear().transpose() * Vector3d(0.10, 0.02, 0.0));
  truth.rotate(Eigen::AngleAxisd(0.01, Vector3d::UnitZ()));
  const Scan first = MakeScan(before, &random);
  const Scan second = MakeScan(before * truth, &random);
  // The odometry is 6 mm short along the corridor, and 8 mm off across it.
  const Pose odometry = {
      truth.translation() +
          before.linear().transpose() * Vector3d(-0.006, 0.008, 0.0),
      Eigen::Quaterniond(truth.linear() *
                         Eigen::AngleAxisd(0.003, Vector3d::UnitX()))};
  // [/scene]
  Print("odometry", odometry, truth, before);

  // [solve]
  double normal_error = 0.0;
  const std::vector<Match> matches = MatchRays(first, second, &normal_error);
  const double tau =
      invgrad::DeterminedStepOptions::TauForNormals(normal_error);

  Pose by_lm = odometry;
  ceres::Problem lm_problem;
  AddAlignment(matches, &by_lm, &lm_problem);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &lm_problem, &summary);
  Print("Levenberg-Marquardt", by_lm, truth, before);

  Pose by_rule = odometry;
  ceres::Problem problem;
  AddAlignment(matches, &by_rule, &problem);
  const std::string rule_report = SolveByRule(tau, &problem);
  Print("rule in ceres::Solve", by_rule, truth, before);

  Pose by_loop = odometry;
  std::string loop_report;
  if (!AlignInALoop(matches, tau, &by_loop, &loop_report)) return 1;
  Print("loop of our own", by_loop, truth, before);
  // [/solve]

  std::printf("\n%zu matches, normals off by %.3f rad, tau = %.3f\n%s\n",
              matches.size(),
              normal_error,
              tau,
              loop_report.c_str());
  return rule_report.empty() ? 1 : 0;
}
