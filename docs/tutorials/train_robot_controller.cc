// A simulator for a robot on two wheels: calibrated by Ceres, then put behind a
// network that learns to park it.
//
// train_robot_controller.md explains this program piece by piece.
//
// Sample runs:
//
//   train_robot_controller
//   train_robot_controller --seconds=2 --folder=/tmp
//   train_robot_controller --nocalibrate --rules=adaptive

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "invgrad/method.h"
#include "invgrad/random.h"
#include "invgrad/time_stepping_simulator.h"
#include "invgrad/train.h"

DEFINE_string(rules,
              "adaptive,"
              "half_inverse:step_size=auto,"
              "adam:step_size=3e-2:schedule=cosine,"
              "ceres_lm:initial_trust_region_radius=1",
              "what to compare; `compare --list` shows all rules and options");
DEFINE_bool(calibrate, true, "train with the geometry found by Ceres");
DEFINE_double(seconds, 6.0, "training time of each rule");
DEFINE_int32(seed, 1, "of the initial weights");
DEFINE_string(folder, ".", "where robot_losses.txt and robot_paths.txt go");

namespace {

using Eigen::Vector3d;
using invgrad::DataSet;
using invgrad::Model;
using invgrad::NumpyRandom;

constexpr int kNumSteps = 16;
constexpr double kTimeStep = 0.25;  // [s]

// [drive]
// One time step of a robot on two wheels. Geometry: radius of the left and of
// the right wheel, and their distance [m]. Wheel speeds: left, right [rad/s].
// Pose: x, y [m], heading [rad]. The heading halfway stands for that of the
// whole step (midpoint rule, order 2). `next` may be `pose`.
template <typename G, typename W, typename T>
void Drive(const G* geometry, const W* wheel_speeds, const T* pose, T* next) {
  using std::cos;
  using std::sin;
  const T left = kTimeStep * geometry[0] * wheel_speeds[0];
  const T right = kTimeStep * geometry[1] * wheel_speeds[1];
  const T turn = (right - left) / geometry[2];
  const T way = 0.5 * (left + right);
  const T heading = pose[2] + 0.5 * turn;
  next[0] = pose[0] + way * cos(heading);
  next[1] = pose[1] + way * sin(heading);
  next[2] = pose[2] + turn;
}
// [/drive]

using Geometry = std::array<double, 3>;
const Geometry kDrawn = {0.1, 0.1, 0.4};      // what the drawings say
const Geometry kTrue = {0.102, 0.099, 0.43};  // what was built

// [calibration]
// A drive with known wheel speeds, after which the pose was measured.
struct MeasuredDrive {
  static constexpr double kNoise = 0.005;  // [m] and [rad]

  std::array<double, 2 * kNumSteps> wheel_speeds;
  std::array<double, 3> pose;  // it begins at (0, 0, 0)

  template <typename T>
  bool operator()(const T* geometry, T* residuals) const {
    T at[3] = {T(0.0), T(0.0), T(0.0)};
    for (int t = 0; t < kNumSteps; ++t) {
      Drive(geometry, &wheel_speeds[2 * t], at, at);
    }
    for (int i = 0; i < 3; ++i) residuals[i] = (at[i] - pose[i]) / kNoise;
    return true;
  }
};

Geometry Calibrate(const std::vector<MeasuredDrive>& drives) {
  Geometry geometry = kDrawn;
  ceres::Problem problem;
  for (const MeasuredDrive& drive : drives) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<MeasuredDrive, 3, 3>(
            new MeasuredDrive(drive)),
        nullptr,
        geometry.data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::printf("%s\n", summary.BriefReport().c_str());
  return geometry;
}
// [/calibration]

std::vector<MeasuredDrive> MeasureDrives(int num_drives) {
  invgrad::NumpyGenerator random(1);
  std::vector<MeasuredDrive> drives(num_drives);
  for (MeasuredDrive& drive : drives) {
    for (double& speed : drive.wheel_speeds) speed = 10.0 * random.Random();
    drive.pose.fill(0.0);
    Vector3d simulated;  // in units of the noise
    CHECK(drive(kTrue.data(), simulated.data()));
    for (int i = 0; i < 3; ++i) {
      drive.pose[i] =
          MeasuredDrive::kNoise * (simulated[i] + random.StandardNormal());
    }
  }
  return drives;
}

// [step]
// The same with wheels that the network controls: u = 1 sets three quarters of
// the top speed.
struct RobotStep {
  static constexpr double kTopSpeed = 10.0;  // [rad/s]
  Geometry geometry;

  template <typename T>
  bool operator()(const T* pose, const T* u, T* next_pose) const {
    using std::tanh;
    const T wheel_speeds[2] = {kTopSpeed * tanh(u[0]), kTopSpeed * tanh(u[1])};
    Drive(geometry.data(), wheel_speeds, pose, next_pose);
    return true;
  }
};
using Robot = invgrad::TimeSteppingSimulator<RobotStep>;
// [/step]

// [model]
// The network is called at every step: from the pose to the wheels' controls.
// It is to be at (0, 0), with heading 0, after the last one.
Model ParkingModel(const Geometry& geometry) {
  const auto robot =
      std::make_shared<Robot>(RobotStep{geometry}, 3, 2, kNumSteps);
  return Model(
      invgrad::DenseNetwork({3, 16, 16, 2}, invgrad::Activation::kTanh),
      robot,
      std::make_shared<invgrad::SquaredNormLoss>(3, 0.5),
      invgrad::Reduction::kMean,
      robot);  // the feedback: it is in the robot's loop over time
}
// [/model]

// [data]
// Poses to start from: the network's first input and the robot's context.
DataSet DrawStarts(int num_samples, NumpyRandom* random) {
  DataSet data;
  data.inputs.resize(3, num_samples);
  for (auto pose : data.inputs.colwise()) {
    pose[0] = random->Uniform(-3.0, -1.5);
    pose[1] = random->Uniform(-1.0, 1.0);
    pose[2] = random->Uniform(-0.8, 0.8);
  }
  data.contexts = data.inputs;
  data.targets.setZero(3, num_samples);
  return data;
}
// [/data]

// The ways of the robot, x and y a line, with an empty line between two starts:
// what gnuplot reads as separate curves.
std::string Paths(const Model& model,
                  const Eigen::VectorXd& weights,
                  const DataSet& starts) {
  std::string error;
  invgrad::DenseNetwork::Activations pass;
  CHECK(model.Forward(
      weights, starts, invgrad::Network::Derivatives::kNone, &pass, &error))
      << error;
  const Eigen::MatrixXd controls = model.SimulatorInputs(pass);
  std::ostringstream text;
  for (int s = 0; s < starts.num_samples(); ++s) {
    Vector3d pose = starts.contexts.col(s);
    text << pose.head<2>().transpose() << "\n";
    for (int t = 0; t < kNumSteps; ++t) {
      const Vector3d before = pose;
      CHECK(model.feedback()->Advance(
          before.data(), controls.col(s).data() + 2 * t, pose.data()));
      text << pose.head<2>().transpose() << "\n";
    }
    text << "\n";
  }
  return text.str();
}

}  // namespace

int main(int argc, char** argv) {
  gflags::SetUsageMessage("calibrates a robot and trains a network to park it");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  google::InitGoogleLogging(argv[0]);
  std::string error;
  std::vector<invgrad::Method> methods;
  if (!invgrad::ParseMethods(FLAGS_rules, &methods, &error)) {
    std::cerr << "--rules: " << error << "\n";
    return 1;
  }
  invgrad::SetBlasThreads(1);

  const Geometry calibrated = Calibrate(MeasureDrives(20));
  std::printf("calibrated: wheels %.5g and %.5g m, distance %.5g m\n\n",
              calibrated[0],
              calibrated[1],
              calibrated[2]);

  // [models]
  const Model model = ParkingModel(FLAGS_calibrate ? calibrated : kDrawn);
  const Model reality = ParkingModel(kTrue);
  // [/models]
  NumpyRandom data_random(0);
  const DataSet train = DrawStarts(256, &data_random);
  const DataSet test = DrawStarts(256, &data_random);

  std::printf("%-38s  train loss  test loss  miss [mm]", "rule");
  std::printf("  real miss [mm]  steps  ms/step  status\n");
  // The root of the mean of |y|^2, in which 1 mrad counts as 1 mm.
  const auto miss = [](double loss) { return 1e3 * std::sqrt(2.0 * loss); };
  std::ofstream losses(FLAGS_folder + "/robot_losses.txt");
  double least_loss = std::numeric_limits<double>::infinity();
  for (const invgrad::Method& method : methods) {
    // [train]
    invgrad::TrainOptions options;
    options.max_time_in_seconds = FLAGS_seconds;
    options.cpu_time = true;
    options.seed = FLAGS_seed;
    std::cerr << "training: " << method.label << "\n";
    const invgrad::TrainResult result =
        invgrad::Train(model, {train, test}, method, options);
    if (!result.error.empty()) {
      std::cerr << method.label << ": " << result.error << "\n";
      return 1;
    }
    const double real_loss = invgrad::MeanLoss(reality, result.weights, test);
    // [/train]
    const invgrad::HistoryRow& last = result.history.back();
    std::printf(
        "%-38s  %10.3g  %9.3g  %9.3g  %14.3g  %5ld  %7.3g  %s\n",
        method.label.c_str(),
        last.train_loss,
        last.test_loss,
        miss(last.test_loss),
        miss(real_loss),
        result.summary.num_steps,
        1e3 * result.summary.train_time_in_seconds / result.summary.num_steps,
        result.summary.message.c_str());
    // A block a rule, begun by its name.
    losses << '"' << method.label << "\"\n";
    for (const invgrad::HistoryRow& row : result.history) {
      if (row.step == 0) continue;  // has no place on a logarithmic axis
      losses << row.seconds << " " << row.test_loss << "\n";
    }
    losses << "\n\n";
    if (last.test_loss < least_loss) {
      least_loss = last.test_loss;
      std::ofstream(FLAGS_folder + "/robot_paths.txt")
          << Paths(model, result.weights, test.Range(0, 12));
    }
  }
  if (!losses.flush()) {
    std::cerr << "cannot write to the folder " << FLAGS_folder << "\n";
    return 1;
  }
  return 0;
}
