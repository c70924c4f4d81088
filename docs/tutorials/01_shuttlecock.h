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

#include <cstdint>
#include <memory>
#include <string>

#include "01_flight.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "problems/sample_data.h"

namespace invgrad {
// [/header]

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
