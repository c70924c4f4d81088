// [header]
// A shuttlecock that a network must send to a given place.
//
//   q' = v,   v' = -|v| v / l - (0, g),   q(0) = 0,   v(0) = x
//   y = q(T),   L = 1/2 |y - y*|^2
//
// The network sees y* and puts out x.
//
// Discretization: classical Runge-Kutta (order 4), 50 steps of 0.02 s.
// Shapes:  network input, x and y: 2, horizontal and vertical.
// Units:   y, y*: m;  x: m/s;  L: m^2.  l = 5 m, g = 9.81 m/s^2, T = 1 s.
// Data:    np.random.seed(data_seed), then for one sample after the other
//          np.random.uniform(1, 12) and np.random.uniform(-1, 2); the first
//          half for training, the other for testing.
// Facts:   the minimum is 0: every target has its launch velocity.
// Source:  Cohen, Darbois Texier, Quere, Clanet. The physics of badminton. New
//          Journal of Physics 17, 063001, 2015: what l is made of.
#ifndef PROBLEMS_SHUTTLECOCK_H_
#define PROBLEMS_SHUTTLECOCK_H_

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"
#include "invgrad/io/numpy_random.h"
#include "problems/sample_data.h"

namespace invgrad {
// [/header]

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

// [problem]
struct Shuttlecock {
  int num_samples = 512;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    const auto generate = [this](int num_rows) {
      NumpyRandom random(static_cast<std::uint32_t>(data_seed));
      Eigen::MatrixXd targets(num_rows, 2);
      for (auto target : targets.rowwise()) {
        target[0] = random.Uniform(1.0, 12.0);
        target[1] = random.Uniform(-1.0, 2.0);
      }
      return targets;
    };
    // 2 columns; 4 numbers a sample: its input and its target.
    if (!MakeData({num_samples, 2, 4.0}, generate, problem, error)) {
      return false;
    }
    DataSet all;
    all.targets = problem->data.transpose();
    all.inputs = all.targets;
    SplitSamples(all, /*batch_size=*/32, problem);
    problem->num_epochs = 100;
    problem->model = std::make_shared<Model>(
        DenseNetwork({2, 16, 16, 2}, Activation::kTanh),
        std::make_shared<AutoDiffSimulator<Flight, 2, 2>>(),
        std::make_shared<SquaredNormLoss>(2, 0.5),
        Reduction::kMean);
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_SHUTTLECOCK_H_
// [/problem]
