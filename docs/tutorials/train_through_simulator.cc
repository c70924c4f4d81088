// Trains a network in front of a simulator, in a program that links nothing but
// the library.
//
// Sample run:
//
//   build/release/bin/train_through_simulator
//
// docs/tutorials/train_through_simulator.md explains each part.

#include <cmath>
#include <cstdio>
#include <memory>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/random.h"
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
  invgrad::NumpyRandom random(0);
  const Eigen::MatrixXd angles = 2.0 * random.Rand(1, 256).array() - 1.0;
  // [/model]

  // [train]
  // [call]
  const invgrad::TrainResult result =
      invgrad::Train(model, {angles, angles}, "adaptive");
  // [/call]
  if (!result.error.empty()) {
    std::fprintf(stderr, "%s\n", result.error.c_str());
    return 1;
  }
  std::printf("%s: loss %.1e after %ld steps\n",
              result.summary.message.c_str(),
              result.history.back().train_loss,
              result.summary.num_steps);
  // [/train]

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
