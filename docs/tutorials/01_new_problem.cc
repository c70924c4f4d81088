// A new problem from nothing to a comparison plot: where must a shuttlecock be
// sent so that it is at a given place one second later?
//
// 01_new_problem.md explains this program piece by piece.
//
// Sample runs:
//
//   01_new_problem
//   01_new_problem --seconds=2 --folder=/tmp
//   01_new_problem --rules=half_inverse:step_size=auto,ceres_lbfgs

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gflags/gflags.h"
#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/data_set.h"
#include "invgrad/chain/dense_network.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/model.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/format.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/methods/method.h"
#include "invgrad/train/train.h"

DEFINE_string(rules,
              "gradient_descent:step_size=3e-2,"
              "adam:step_size=1e-2:schedule=cosine,"
              "half_inverse,gauss_newton,"
              "levenberg_marquardt:relative_damping=1e-8,"
              "ceres_lm:linear_solver=dense_normal_cholesky",
              "what to compare; `compare --list` shows all rules and options");
DEFINE_double(seconds, 6.0, "training time of each rule");
DEFINE_int32(seed, 1, "of the initial weights");
DEFINE_string(folder, ".", "where shuttlecock_losses.txt goes");

namespace {

using invgrad::DataSet;
using invgrad::FormatNumber;
using invgrad::HistoryRow;
using invgrad::Method;
using invgrad::Model;
using invgrad::NumpyRandom;
using invgrad::Simulator;
using invgrad::TrainOptions;
using invgrad::TrainResult;

// [functor]
// Where a shuttlecock is, one second after it was hit with velocity x [m/s].
struct Flight {
  static constexpr double kGravity = 9.81;    // [m/s^2]
  static constexpr double kDragLength = 5.0;  // [m], terminal velocity 7 m/s
  static constexpr double kTime = 1.0;        // [s]
  static constexpr int kNumSteps = 50;

  // d(position, velocity)/dt.
  template <typename T>
  static void Derivative(const T* state, T* derivative) {
    using std::sqrt;
    const T& v0 = state[2];
    const T& v1 = state[3];
    // A speed of 1 um/s at rest: sqrt has no derivative at 0.
    const T speed = sqrt(v0 * v0 + v1 * v1 + 1e-12);
    derivative[0] = v0;
    derivative[1] = v1;
    derivative[2] = -speed * v0 / kDragLength;
    derivative[3] = -speed * v1 / kDragLength - kGravity;
  }

  // From velocity x (2) to position y (2), by the classical Runge-Kutta method.
  template <typename T>
  bool operator()(const T* x, T* y) const {
    const double h = kTime / kNumSteps;
    T s[4] = {T(0.0), T(0.0), x[0], x[1]};
    T k1[4], k2[4], k3[4], k4[4], stage[4];
    for (int step = 0; step < kNumSteps; ++step) {
      Derivative(s, k1);
      for (int i = 0; i < 4; ++i) stage[i] = s[i] + (0.5 * h) * k1[i];
      Derivative(stage, k2);
      for (int i = 0; i < 4; ++i) stage[i] = s[i] + (0.5 * h) * k2[i];
      Derivative(stage, k3);
      for (int i = 0; i < 4; ++i) stage[i] = s[i] + h * k3[i];
      Derivative(stage, k4);
      for (int i = 0; i < 4; ++i) {
        s[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
      }
    }
    y[0] = s[0];
    y[1] = s[1];
    return true;
  }
};
// [/functor]

// [check]
// The largest difference between the Jacobian by Jets and central differences,
// in units of the largest entry.
double JacobianError(const Simulator& simulator, const Eigen::Vector2d& x) {
  Eigen::Vector2d y, y_plus, y_minus;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> J, differences;
  simulator.Evaluate(x.data(), nullptr, y.data(), J.data());
  const double h = 1e-5 * x.norm();  // errors h^2 and epsilon / h balance
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d x_plus = x + h * Eigen::Vector2d::Unit(i);
    const Eigen::Vector2d x_minus = x - h * Eigen::Vector2d::Unit(i);
    simulator.Evaluate(x_plus.data(), nullptr, y_plus.data(), nullptr);
    simulator.Evaluate(x_minus.data(), nullptr, y_minus.data(), nullptr);
    differences.col(i) = (y_plus - y_minus) / (2.0 * h);
  }
  return (J - differences).cwiseAbs().maxCoeff() / J.cwiseAbs().maxCoeff();
}
// [/check]

// [data]
// Places to be at, up to a court's length away. The network sees the target.
DataSet DrawTargets(int num_samples, NumpyRandom* random) {
  DataSet data;
  data.targets.resize(2, num_samples);
  for (int s = 0; s < num_samples; ++s) {
    data.targets(0, s) = random->Uniform(1.0, 12.0);  // distance [m]
    data.targets(1, s) = random->Uniform(-1.0, 2.0);  // height [m]
  }
  data.inputs = data.targets;
  data.contexts.resize(0, num_samples);
  return data;
}
// [/data]

int Run() {
  std::string error;
  std::vector<Method> methods;
  if (!invgrad::ParseMethods(FLAGS_rules, &methods, &error)) {
    std::cerr << "--rules: " << error << "\n";
    return 1;
  }
  invgrad::SetBlasThreads(1);

  // [simulator]
  const auto simulator =
      std::make_shared<invgrad::AutoDiffSimulator<Flight, 2, 2>>();
  std::cout << "Jacobian against finite differences: soft "
            << FormatNumber(JacobianError(*simulator, {3.0, 5.0}), 1)
            << ", smash "
            << FormatNumber(JacobianError(*simulator, {60.0, 9.0}), 1) << "\n"
            << std::endl;
  // [/simulator]

  // [model]
  const Model model(
      invgrad::DenseNetwork({2, 16, 16, 2}, invgrad::Activation::kTanh),
      simulator,
      std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
      invgrad::Reduction::kMean);
  NumpyRandom random(FLAGS_seed);
  const Eigen::VectorXd initial_weights = model.network().InitialWeights(
      invgrad::Initialization::kGlorotUniform, &random);
  // [/model]
  NumpyRandom data_random(0);
  const DataSet train = DrawTargets(512, &data_random);
  const DataSet test = DrawTargets(512, &data_random);

  // [train]
  std::printf("%-45s  %10s  %9s  %9s  %6s  %7s  %s\n",
              "rule",
              "train loss",
              "test loss",
              "miss [cm]",
              "steps",
              "ms/step",
              "status");
  std::ofstream losses(FLAGS_folder + "/shuttlecock_losses.txt");
  for (const Method& method : methods) {
    TrainOptions options;
    options.max_time_in_seconds = FLAGS_seconds;
    options.batch_size = 32;
    options.initial_weights = initial_weights;
    std::cerr << "training: " << method.label << "\n";
    const TrainResult result =
        invgrad::Train(model, {train, test}, method, options);
    if (!result.error.empty()) {
      std::cerr << method.label << ": " << result.error << "\n";
      return 1;
    }
    // [/train]

    // [row]
    const HistoryRow& last = result.history.back();
    std::printf(
        "%-45s  %10.3g  %9.3g  %9.3g  %6ld  %7.3g  %s\n",
        method.label.c_str(),
        last.train_loss,
        last.test_loss,
        100.0 * std::sqrt(2.0 * last.test_loss),
        result.summary.num_steps,
        1e3 * result.summary.train_time_in_seconds / result.summary.num_steps,
        result.summary.message.c_str());
    // A block a rule, begun by its name.
    losses << '"' << method.label << "\"\n";
    for (const HistoryRow& row : result.history) {
      if (row.step == 0) continue;  // has no place on a logarithmic axis
      losses << row.seconds << " " << row.test_loss << "\n";
    }
    losses << "\n\n";
    // [/row]
  }
  if (!losses.flush()) {
    std::cerr << "cannot write to the folder " << FLAGS_folder << "\n";
    return 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  gflags::SetUsageMessage("trains a network to aim a shuttlecock");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  return Run();
}
