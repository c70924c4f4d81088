// Trains networks whose output layer is solved by least squares, in front of
// linear and of nonlinear physics.
//
// Sample run:
//
//   build/release/bin/solve_output_layer
//
// docs/tutorials/solve_output_layer.md explains each part.

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/simulator.h"
#include "invgrad/train.h"

namespace {

constexpr int kPoints = 12;

// [string]
// The loads y of a stretched string, from its deflections x at 12 points:
// y = A x, the negative second difference.
std::shared_ptr<const invgrad::Simulator> StringUnderLoad() {
  Eigen::MatrixXd A = 2.0 * Eigen::MatrixXd::Identity(kPoints, kPoints);
  A.diagonal(1).setConstant(-1.0);
  A.diagonal(-1).setConstant(-1.0);
  return std::make_shared<invgrad::LinearSimulator>(
      A.sparseView(), Eigen::VectorXd::Zero(kPoints));
}

// Loads of 2,000 strings: a bump of unit height anywhere on the string.
Eigen::MatrixXd Bumps() {
  Eigen::MatrixXd loads(kPoints, 2000);
  for (int s = 0; s < loads.cols(); ++s) {
    const double center =
        kPoints * (s + 0.5) / static_cast<double>(loads.cols());
    for (int i = 0; i < kPoints; ++i) {
      loads(i, s) = std::exp(-0.5 * std::pow(i + 0.5 - center, 2));
    }
  }
  return loads;
}
// [/string]

// The angle [rad] after one second of a pendulum that gets the push x [1/s^2].
struct Pendulum {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    constexpr double kTimeStep = 0.01;  // [s]
    T angle(0.0);
    T velocity(0.0);
    for (int i = 0; i < 100; ++i) {
      velocity += kTimeStep * (x[0] - 9.81 * sin(angle) - 0.5 * velocity);
      angle += kTimeStep * velocity;
    }
    y[0] = angle;
    return true;
  }
};

void Report(const std::string& method, const invgrad::TrainResult& result) {
  if (!result.error.empty()) {
    std::printf("  %s\n", result.error.c_str());
    return;
  }
  std::printf("  %-36s loss %.1e after %ld steps\n",
              method.c_str(),
              result.history.back().train_loss,
              result.summary.num_steps);
}

}  // namespace

int main() {
  invgrad::SetBlasThreads(1);
  // [linear]
  using invgrad::DenseNetwork;
  const invgrad::Model strings(
      DenseNetwork({kPoints, 32, 32, kPoints}, invgrad::Activation::kTanh),
      StringUnderLoad(),
      std::make_shared<invgrad::SquaredNormLoss>(kPoints, 0.5),
      invgrad::Reduction::kMean);
  const Eigen::MatrixXd loads = Bumps();
  invgrad::TrainOptions options;
  options.max_num_steps = 3000;
  options.shuffle = true;
  std::printf("strings\n");
  for (const std::string method : {"adam", "adam:output_layer=exact"}) {
    Report(method, invgrad::Train(strings, {loads, loads}, method, options));
  }
  // [/linear]

  // [nonlinear]
  const invgrad::Model pendulum(
      DenseNetwork({1, 16, 16, 1}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::AutoDiffSimulator<Pendulum, 1, 1>>(),
      std::make_shared<invgrad::SquaredNormLoss>(1, 0.5),
      invgrad::Reduction::kMean);
  const Eigen::MatrixXd angles = Eigen::RowVectorXd::LinSpaced(256, -1.0, 1.0);
  options.max_num_steps = 200;
  options.batch_size = 0;  // all samples in each step
  std::printf("pendulum\n");
  for (const std::string method :
       {"adam",
        "adam:output_layer=exact",
        "levenberg_marquardt:step_size=auto",
        "levenberg_marquardt:step_size=auto:output_layer=exact"}) {
    Report(method, invgrad::Train(pendulum, {angles, angles}, method, options));
  }
  // [/nonlinear]

  // [auto]
  const invgrad::Model curve(
      DenseNetwork({1, 16, 16, 16, 1}, invgrad::Activation::kGelu),
      std::make_shared<invgrad::IdentitySimulator>(1),
      std::make_shared<invgrad::SquaredNormLoss>(1, 0.5),
      invgrad::Reduction::kMean);
  const Eigen::MatrixXd inputs = Eigen::RowVectorXd::LinSpaced(1024, -1.0, 1.0);
  const Eigen::MatrixXd values = inputs.unaryExpr(
      [](double a) { return std::exp(-10.0 * a * a) * std::sin(2.0 * a); });
  options.max_num_steps = 5000;
  options.batch_size = 32;
  std::printf("curve\n");
  for (const std::string method :
       {"adam", "adam:output_layer=exact", "adam:output_layer=auto"}) {
    const invgrad::TrainResult result =
        invgrad::Train(curve, {inputs, values}, method, options);
    Report(method, result);
    if (method == "adam:output_layer=auto") {
      std::printf("  %s\n", result.summary.message.c_str());
    }
  }
  // [/auto]

  // [refused]
  const invgrad::TrainResult refused = invgrad::Train(
      pendulum, {angles, angles}, "ceres_lm:output_layer=exact", options);
  std::printf("%s\n", refused.error.c_str());
  // [/refused]
  return 0;
}
