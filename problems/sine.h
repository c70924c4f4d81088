// A simulator with a sine: many pre-images, and sensitivities that differ by a
// factor xi^2 along axes rotated by phi.
//
//   h = diag(10 / xi, 10 xi) R(phi) x,   y = (sin h_0, h_1)
//   L = 1/2 |y - y*|^2,   y* uniform in [-1, 1]^2
//
// Shapes:  network 2-32-64-32-2, ReLU, 4,354 weights, its input is y*;
//          x, y: 2.
// Units:   none. R(phi) = [cos phi, -sin phi; sin phi, cos phi]; this follows
//          the paper's code; its text has sin(x_0) / xi and no 10.
// Data:    np.random.seed(data_seed); 2 np.random.rand(2 N, 2) - 1, the first N
//          for training. (The code draws new samples for every step.)
// Inverse: of the two families h_0 = asin y_0 + 2 pi k and
//          pi - asin y_0 + 2 pi k the h_0 closest to that of x_0; h_1 = y_1.
//          Local; |y_0| > 1 has no pre-image.
// Facts:   distance to the closest solution, |x - P^-1(y*; x)|, after 600 s
//          on a GPU, read off figures: over xi, xi = 32, phi = 0: SIP 3.9e-4,
//          Adam 4.4e-4; as it is, xi = 32, phi = 45: SIP 1.2e-2, Adam 0.33.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, section 4.1, arXiv 2109.15048,
//          and its code, sin_characterization/; PBDL, chapter physgrad-nn.
#ifndef PROBLEMS_SINE_H_
#define PROBLEMS_SINE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

struct Sine {
  struct Options {
    double xi = 1.0;
    double phi = 0.0;
    int num_samples = 10000;
    int data_seed = 0;
    std::string metric = "distance";
    void Describe(OptionSet* set) {
      set->Add("xi", &xi, {0.0, 1e6, true}, "conditioning");
      set->Add("phi", &phi, {-360.0, 360.0}, "rotation, degrees");
      DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
      set->Add("metric",
               &metric,
               {"distance", "relative_distance"},
               "to the closest solution, as it is or over xi");
    }
  };

  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);
};

// The same physics for one target, without a network: PBDL's picture of the
// landscape.
struct SinePoint {
  struct Options {
    double xi = 1.0;
    double phi = 15.0;
    double target_0 = 0.3;
    double target_1 = -0.5;
    double start_0 = 0.22;
    double start_1 = -0.02;
    void Describe(OptionSet* set) {
      set->Add("xi", &xi, {0.0, 1e6, true}, "conditioning");
      set->Add("phi", &phi, {-360.0, 360.0}, "rotation, degrees");
      set->Add("target_0", &target_0, {-1.0, 1.0}, "y*_0");
      set->Add("target_1", &target_1, {}, "y*_1");
      set->Add("start_0", &start_0, {}, "x_0 at the start");
      set->Add("start_1", &start_1, {}, "x_1 at the start");
    }
  };

  static bool Create(const Options& options,
                     PointProblem* problem,
                     std::string* error);
};

}  // namespace invgrad

#endif  // PROBLEMS_SINE_H_
