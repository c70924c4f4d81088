// Trains a network in front of a simulator, in a program of one's own: no
// flags, no tables, only the library.
//
// Sample run:
//
//   build/release/bin/07_training
//
// docs/tutorials/07_training.md explains each part.

#include <cmath>
#include <cstdio>
#include <memory>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/train.h"

namespace {

// [simulator]
// A pendulum at rest gets a constant push x [1/s^2] for one second; y is its
// angle [rad] then.
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
// [/simulator]

}  // namespace

int main() {
  invgrad::SetBlasThreads(1);
  // [model]
  using invgrad::DenseNetwork;
  const invgrad::Model model(
      DenseNetwork({1, 16, 16, 1}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::AutoDiffSimulator<Pendulum, 1, 1>>(),
      std::make_shared<invgrad::SquaredNormLoss>(1, 0.5),
      invgrad::Reduction::kMean);
  // Wanted angles: what the network gets, and what the pendulum should do.
  const Eigen::MatrixXd angles = Eigen::RowVectorXd::LinSpaced(256, -1.0, 1.0);
  // [/model]

  // [train]
  // [call]
  const invgrad::TrainResult result =
      invgrad::Train(model, {angles, angles}, "adaptive");
  // [/call]
  std::printf("%s: loss %.1e after %ld steps\n",
              result.summary.message.c_str(),
              result.history.back().train_loss,
              result.summary.num_steps);
  // [/train]

  // [run]
  invgrad::TrainOptions options;
  options.max_num_epochs = 30;
  options.shuffle = true;
  invgrad::TrainingRun run(
      model, {angles, angles}, "adam:epochs=10>half_inverse", options);
  while (run.Step()) {
    if (run.step() % 60 == 0) {
      std::printf(
          "epoch %2.0f  loss of the batch %.1e\n", run.epoch(), run.loss());
    }
  }
  if (!run.error().empty()) {
    std::fprintf(stderr, "%s\n", run.error().c_str());
    return 1;
  }
  // [/run]

  // [use]
  const Eigen::MatrixXd x = model.network().Outputs(
      result.weights, Eigen::MatrixXd::Constant(1, 1, 0.7));
  const double push = x(0, 0);
  double angle = 0.0;
  Pendulum()(&push, &angle);
  std::printf("wanted 0.7 rad: push %.4f, angle %.6f\n", push, angle);
  // [/use]
  return 0;
}
