// Which parameters do my residuals not determine? A robot drives a loop, and
// ceres::Covariance says "rank deficient".
//
// find_undetermined_parameters.md explains this program piece by piece.
//
//   find_undetermined_parameters

#include <array>
#include <cmath>
#include <iostream>
#include <string>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "invgrad/rank_report.h"

namespace {

using invgrad::Gauge;
using invgrad::GaugeBlock;
using invgrad::GaugeComponent;
using invgrad::RankReport;

constexpr int kNumPoses = 8;

// [odometry]
// Measurements between two poses (x, y, angle): turns of the wheel forward and
// sideways, and the angle from the gyroscope.
// calibration: the wheel's radius [m], and the camera's time offset [s].
struct Odometry {
  template <typename T>
  bool operator()(const T* a, const T* b, const T* calibration, T* r) const {
    using std::cos;
    using std::sin;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    r[0] = (cos(a[2]) * dx + sin(a[2]) * dy) / calibration[0] - forward;
    r[1] = (-sin(a[2]) * dx + cos(a[2]) * dy) / calibration[0] - sideways;
    r[2] = b[2] - a[2] - turn;
    return true;
  }
  double forward;
  double sideways;
  double turn;
};
// [/odometry]

// [distance]
// The distance of two poses, measured by a tape.
struct Distance {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    using std::sqrt;
    const T dx = b[0] - a[0];
    const T dy = b[1] - a[1];
    r[0] = sqrt(dx * dx + dy * dy) - measured;
    return true;
  }
  double measured;  // [m]
};
// [/distance]

// [robot]
struct Robot {
  std::array<double, 3> poses[kNumPoses];
  double calibration[2] = {0.1, 0.0};
};

// A loop of eight poses. Each of them is measured from the two before it.
void AddOdometry(Robot* robot, ceres::Problem* problem) {
  const double turn = 6.283185307179586 / kNumPoses;
  for (int i = 0; i < kNumPoses; ++i) {
    robot->poses[i] = {
        2.0 * std::sin(turn * i), 2.0 - 2.0 * std::cos(turn * i), turn * i};
  }
  for (int i = 0; i < kNumPoses; ++i) {
    for (const int j : {i + 1, i + 2}) {
      const double angle = turn * (j - i);
      const double radius = 2.0 / robot->calibration[0];
      problem->AddResidualBlock(
          new ceres::AutoDiffCostFunction<Odometry, 3, 3, 3, 2>(
              new Odometry{radius * std::sin(angle),
                           radius * (1.0 - std::cos(angle)),
                           j < kNumPoses ? angle : angle - turn * kNumPoses}),
          nullptr,
          robot->poses[i].data(),
          robot->poses[j % kNumPoses].data(),
          robot->calibration);
    }
  }
}
// [/robot]

// [gauge]
// A larger wheel on a longer path makes the same turns.
Gauge WheelAndPath(const Robot& robot) {
  Gauge gauge;
  gauge.name = "size of the path and of the wheel";
  gauge.generators = {"scale"};
  gauge.motions = [&robot](const GaugeComponent& component,
                           Eigen::MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      const bool is_pose = block.values != robot.calibration;
      const int num_lengths = is_pose ? 2 : 1;  // x and y, or the radius
      for (int i = 0; i < num_lengths; ++i) {
        (*motions)(block.offset + i, 0) = block.values[i];
      }
    }
    return true;
  };
  return gauge;
}
// [/gauge]

// [print]
bool Print(const RankReport::Options& options, const ceres::Problem& problem) {
  RankReport report;
  std::string error;
  if (!ComputeRankReport(options, problem, &report, &error)) {
    std::cerr << error << "\n";
    return false;
  }
  std::cout << report.ToText() << "\n";
  return true;
}
// [/print]

}  // namespace

int main() {
  Robot robot;
  ceres::Problem problem;
  AddOdometry(&robot, &problem);

  // [report]
  RankReport::Options options;
  options.block_name = [&robot](const double* values) -> std::string {
    for (int i = 0; i < kNumPoses; ++i) {
      if (values == robot.poses[i].data()) return "pose " + std::to_string(i);
    }
    return "calibration";
  };
  std::cout << "=== as it is\n";
  if (!Print(options, problem)) return 1;
  // [/report]

  // [own]
  options.gauges = {WheelAndPath(robot)};
  problem.SetParameterBlockConstant(robot.poses[0].data());
  std::cout << "=== pose 0 held, and a gauge of our own\n";
  if (!Print(options, problem)) return 1;
  // [/own]

  // [cure]
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Distance, 1, 3, 3>(new Distance{4.0}),
      nullptr,
      robot.poses[0].data(),
      robot.poses[4].data());
  problem.SetManifold(robot.calibration, new ceres::SubsetManifold(2, {1}));
  std::cout << "=== with a length, and without the time offset\n";
  if (!Print(options, problem)) return 1;
  // [/cure]
  return 0;
}
